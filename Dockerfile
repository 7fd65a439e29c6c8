# Debian with everything that `make run` and `make test` need.
#
#   docker build -t mrl-driver .
#   docker run -it mrl-driver make run
#   docker run -it --device /dev/ttyACM0 mrl-driver make run PORT=/dev/ttyACM0
ARG BASE=debian:trixie-slim
FROM ${BASE}
RUN apt-get update && apt-get install -y --no-install-recommends git make ca-certificates && rm -f /var/lib/apt/lists/*_*
# The commit that is checked out, without what was built here.
COPY .git /tmp/mrl-driver.git
RUN git clone -q /tmp/mrl-driver.git /mrl-driver && rm -r /tmp/mrl-driver.git
WORKDIR /mrl-driver
RUN make setup firmware pc-firmware && apt-get clean && rm -f /var/lib/apt/lists/*_*
CMD ["make", "run"]
