#!/usr/bin/env bash
# What a newcomer does, in minimal Debian systems: `make run` and `make test` in a clone of HEAD.  Needs root.
#
#   RELEASES="bookworm trixie"     which Debian releases
#   WAYS="root user container"     as root, as a user with sudo, as root with the capabilities of an unprivileged container;
#        image                     in the image that the Dockerfile makes of the release; needs buildah
#   COMMANDS="pip run test"        which of the README's commands: its way with pip, make run, make test, or another target of make;
#        wheel                     the wheel of build/dist in an empty environment, without a compiler: time to the first motion
#   ARCH=arm64                     which architecture; qemu emulates one that is not this machine's, about ten times slower
#
# Apt mirror, proxies, certificates and pip's settings are this machine's.  Each system lives in a folder below TMPDIR or /var/tmp, and
# in namespaces of its own, so that nothing stays mounted or running.  Logs are in build/fresh.
set -euo pipefail

ROOT=$(realpath "$(dirname "$0")/..")
LOGS=$ROOT/build/fresh
FOLDER="my Röboter" # of the clone, below the user's home
PIP_WAY=': pip install, mrl demo
set -e
[ $(id -u) = 0 ] || sudo=sudo
$sudo apt-get update -q
$sudo apt-get install -qy git make python3-venv
eval "$(sed -n "/^python3 -m venv/,/^pip install/p" README.md)"
play() { # COMMAND WORDS KEYS WORDS: once the first words are shown, presses keys; once the others are, q
  mkfifo keys
  TERM=xterm timeout 1200 script -qefc "$1" shown <keys &
  exec 3>keys
  while kill -0 $! && ! grep -q "$2" shown; do sleep 0.1; done
  while kill -0 $! && ! grep -q "$4" shown; do printf "$3" >&3; sleep 0.1; done
  printf q >&3
  wait $!
  rm keys
}
play "mrl demo" quit w "x +0.0[1-9]"
play "mrl demo --web" "q ends" "" "http://127.0.0.1"'
WHEEL_WAY=': wheel without a compiler
set -e
[ $(id -u) = 0 ] || sudo=sudo
$sudo apt-get update -q
$sudo apt-get install -qy --no-install-recommends python3-venv avrdude
python3 -m tests.packaging.first_motion .
python3 -m tests.packaging.first_motion /mnt/*.whl'
PASSED_ON='^(MRL_TEST_PATIENCE|PIP_(INDEX_URL|CERT|PROXY|TRUSTED_HOST|DEFAULT_TIMEOUT)|https?_proxy|no_proxy|HTTPS?_PROXY|NO_PROXY)='

fail() { echo "test-fresh: $*" >&2; exit 1; }

# Runs a command, its output going to a log; prints how long it took, and the log's end if it failed.
timed() { # NAME LOG COMMAND...
  local name=$1 log=$2 start=$SECONDS code=0
  shift 2
  "$@" >"$log" 2>&1 </dev/null || code=$?
  printf '%-34s %5d s  %s\n' "$name" $((SECONDS - start)) "$([ $code = 0 ] && echo passed || echo "failed with $code: $log")"
  [ $code = 0 ] || tail -n 40 "$log" | sed 's/^/    /'
  return $code
}

mirror() {
  apt-get indextargets --format '$(SITE)' 'Created-By: Packages' 'Origin: Debian' 'Label: Debian' | head -1 | grep . ||
    fail "apt knows no mirror of Debian; run apt-get update"
}

# Lets the kernel run programs of ARCH, by qemu, until this program ends.
emulate() {
  local kinds=/proc/sys/fs/binfmt_misc native qemu
  native=$(dpkg --print-architecture)
  [ "$ARCH" != "$native" ] && ! arch-test "$ARCH" >/dev/null || return 0
  case $ARCH in arm64) qemu=qemu-aarch64 ;; armhf) qemu=qemu-arm ;; *) fail "got ARCH=$ARCH, expected $native, arm64 or armhf" ;; esac
  [ -e $kinds/register ] || mount -t binfmt_misc binfmt_misc $kinds
  sed 's/F$/CF/' /usr/lib/binfmt.d/$qemu.conf >$kinds/register # C: sudo is root
  ENDS="echo -1 >$kinds/$qemu"
  arch-test "$ARCH" >/dev/null || fail "qemu does not run programs of $ARCH here"
}

# What of this machine a system needs to reach the mirrors.
settings() { # TREE
  cp /etc/resolv.conf "$1/etc/resolv.conf"
  [ -e "$1/etc/hosts" ] || echo "127.0.0.1 localhost $(hostname)" >"$1/etc/hosts" # as an installer or a container's runtime writes it
  apt-config dump | grep -E '^Acquire::(https?|Check|Retries)[^ ]* "[^"]' >"$1/etc/apt/apt.conf.d/90host" || true
  echo force-unsafe-io >"$1/etc/dpkg/dpkg.cfg.d/fresh" # nobody needs this system after a loss of power
  printf '#!/bin/sh\nexit 101\n' >"$1/usr/sbin/policy-rc.d" # packages start no services
  chmod +x "$1/usr/sbin/policy-rc.d"
  if ls /usr/local/share/ca-certificates/*.crt >/dev/null 2>&1; then
    cp /usr/local/share/ca-certificates/*.crt "$1/usr/local/share/ca-certificates/"
    chroot "$1" update-ca-certificates >/dev/null 2>&1
  fi
  { # what pip needs to reach its index, but no files of this machine's disk
    echo '[global]'
    cat /etc/pip.conf ~/.config/pip/pip.conf 2>/dev/null |
      awk '/^(index-url|cert|proxy|trusted-host|timeout) *=/ { last[$1] = $0 } END { for (key in last) print last[key] }' || true
  } >"$1/etc/pip.conf"
}

# Mounts of a system, in the mount namespace of its own.
mounts() { # TREE ARCHIVES
  mount -t proc proc "$1/proc"
  mount -t sysfs -o ro sys "$1/sys"
  mount -t tmpfs -o mode=755 dev "$1/dev"
  local node
  for node in null zero full random urandom tty; do
    touch "$1/dev/$node"
    mount --bind "/dev/$node" "$1/dev/$node"
  done
  mkdir "$1/dev/pts" "$1/dev/shm"
  mount -t devpts -o newinstance,ptmxmode=0666,mode=620,gid=5 pts "$1/dev/pts"
  mount -t tmpfs -o mode=1777 shm "$1/dev/shm"
  ln -s pts/ptmx "$1/dev/ptmx"
  ln -s /proc/self/fd "$1/dev/fd"
  local n=0
  for node in stdin stdout stderr; do ln -s "/proc/self/fd/$((n++))" "$1/dev/$node"; done
  mount --bind "$2" "$1/var/cache/apt/archives"
}

# Everything in one system; process 1 of a process namespace, in a mount namespace.
inside() { # RELEASE WAY TREE ARCHIVES
  local release=$1 way=$2 tree=$3 log="$LOGS/$1-$2"
  local clone=$HOME_IN/$FOLDER enter=(chroot "$tree") as=()
  mounts "$tree" "$4"
  mount --bind "$LOGS" "$tree/mnt" 
  case $way in
    user) as=(setpriv --reuid newcomer --regid newcomer --init-groups) ;;
    # No namespaces of users either: the kernel refuses them below a chroot, as a container's runtime does.
    container) as=(setpriv --bounding-set -sys_admin,-net_admin) ;;
  esac
  if [ "$way" != container ]; then # a root of its own, where users may make namespaces as on a real machine
    mount --rbind "$tree" "$tree"
    cd "$tree"
    mkdir -p old
    pivot_root . old
    cd /
    umount -l /old
    rmdir /old
    log=/mnt/$release-$way
    enter=()
  fi
  local env=(env -i "HOME=$HOME_IN" PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin TERM=dumb LANG=C.UTF-8)
  local line
  while IFS= read -r line; do env+=("$line"); done < <(env | grep -E "$PASSED_ON")
  do_in() { "${enter[@]}" "${as[@]}" "${env[@]}" sh -c "cd '$clone' && $1"; }

  if [ "$way" = root ] && do_in "apt-get update -q" >"$log-apt.log" 2>&1 </dev/null; then
    for line in pip run test setup; do apt_sizes $line >"$log-$line-$ARCH.sizes" 2>&1 </dev/null || true; done
  fi
  commands "$release, $way" "$log"
}

# The Dockerfile's image and everything in it; process 1 of a process namespace, in a mount namespace.
image() { # RELEASE TREE CONTEXT
  local name="$1, image" log="$LOGS/$1-image" storage=(buildah --root "$2.storage" --runroot "$2.run") base container
  export BUILDAH_ISOLATION=chroot STORAGE_DRIVER=vfs
  mount -t proc proc /proc
  base=$("${storage[@]}" from scratch)
  cp -a "$2/." "$("${storage[@]}" mount "$base")"
  "${storage[@]}" commit -q --rm "$base" minimal >/dev/null
  timed "$name: build" "$log-build.log" "${storage[@]}" build --build-arg BASE=localhost/minimal -t mrl-driver "$3" || return
  container=$("${storage[@]}" from mrl-driver)
  local enter=("${storage[@]}" run "$container" --)
  do_in() { "${enter[@]}" sh -c "$1"; }
  commands "$name" "$log"
}

# The commands, each by `do_in`, and what they leave.
commands() { # NAME LOG
  local command line name code=0
  for command in $COMMANDS; do
    case $command in run) line="make run DURATION=8" ;; pip) line=$PIP_WAY ;; wheel) line=$WHEEL_WAY ;; *) line="make $command" ;; esac
    name=${line%%$'\n'*}
    timed "$1: ${name#: }" "$2-$command.log" do_in "$line" || code=1
    [ ! -e "$2-$command-$ARCH.sizes" ] || venv_size "$command" >>"$2-$command-$ARCH.sizes" || true
    [ $command != wheel ] || grep -E ', Python 3|^pip install' "$2-wheel.log" >"$2-wheel-$ARCH.sizes" || true
    grep -hE '^(SKIPPED|[0-9]+ upgraded|Need to get|After this|ran |pip install|mrl (web|flash)|.+, Python 3)| passed' "$2-$command.log" | awk '!seen[$0]++ { print "    " $0 }'
  done
  timed "$1: packages' files" "$2-dpkg.log" unchanged || code=1
  timed "$1: processes left" "$2-processes.log" nothing_runs || code=1
  return $code
}

# What a command needs in this system, for `make test-fresh` to keep: in apt's own words before it, and the kB of its virtual environment after it.
apt_sizes() { # COMMAND
  local tier=$1
  [ "$1" != pip ] || tier=quick
  do_in "apt-get install -qy --print-uris --no-install-recommends \
    \$(make -n apt PACKAGES_apt='\$(PACKAGES_$tier)' | sed -n 's/^echo \"Debian packages that are missing: \(.*\)\"/\1/p')"
}
venv_size() { # COMMAND
  local venv=.venv
  [ "$1" != pip ] || venv='~/mrl-venv'
  do_in "du -sk $venv"
}

# Whether each file of each package is as it came.
unchanged() {
  local changed
  changed=$("${enter[@]}" dpkg -V | grep -v ' c /etc/' || true)
  [ -z "$changed" ] || { echo "$changed"; return 1; }
}

# Whether the commands have left a process.
nothing_runs() {
  local found=0 process
  for process in /proc/[0-9]*; do
    [ "${process#/proc/}" != 1 ] && [ "${process#/proc/}" != $BASHPID ] && [ -s "$process/cmdline" ] || continue
    tr '\0' ' ' <"$process/cmdline" && echo && found=1
  done
  return $found
}

outside() {
  [ "$(id -u)" = 0 ] || fail "needs root"
  mkdir -p "$LOGS"
  rm -f "$LOGS"/*.sizes
  local work release way tree code=0
  work=$(mktemp -d "${TMPDIR:-/var/tmp}/mrl-fresh.XXXXXX")
  trap "rm -rf --one-file-system '$work'; eval \"\$ENDS\"" EXIT
  trap 'exit 130' INT TERM HUP
  unset TMPDIR # which the systems do not have
  emulate
  for release in $RELEASES; do
    local archives=$work/archives-$release base=$work/$release.tar
    mkdir -p "$archives/partial"
    timed "$release: minimal system" "$LOGS/$release.log" \
      mmdebstrap --architectures="$ARCH" --variant=minbase --dpkgopt=force-unsafe-io --include=git,make,ca-certificates "$release" "$base" "${MIRROR:-$(mirror)}" || exit 1
    for way in $WAYS; do
      tree=$work/$release-$way
      export HOME_IN=/root
      [ "$way" != user ] || HOME_IN=/home/newcomer
      mkdir "$tree" && tar -xf "$base" -C "$tree"
      [ "$way" != user ] || chroot "$tree" useradd -m -s /bin/bash newcomer
      settings "$tree"
      if [ "$way" = user ]; then
        chroot "$tree" sh -c 'apt-get update -q && apt-get install -qy sudo' >>"$LOGS/$release.log" 2>&1
        echo 'newcomer ALL=(ALL) NOPASSWD: ALL' >"$tree/etc/sudoers.d/newcomer"
      fi
      git -c advice.detachedHead=false clone -q "$BUNDLE" "$tree$HOME_IN/$FOLDER"
      [ "$way" != user ] || chroot "$tree" chown -R newcomer: /home/newcomer
      local task=(inside "$release" "$way" "$tree" "$archives")
      if [ "$way" = image ]; then
        mv "$tree$HOME_IN/$FOLDER" "$tree.clone"
        task=(image "$release" "$tree" "$tree.clone")
      fi
      unshare --mount --pid --fork --kill-child --propagation private "$0" "${task[@]}" || code=1
      rm -rf --one-file-system "$tree"*
    done
    rm -rf "$base" "$archives"
  done
  exit $code
}

export ARCH=${ARCH:-$(dpkg --print-architecture)} ENDS=
export RELEASES=${RELEASES:-bookworm trixie} WAYS=${WAYS:-root user container} COMMANDS=${COMMANDS:-run test}
if [ "${1:-}" = inside ] || [ "${1:-}" = image ]; then
  "$@"
else
  BUNDLE=${1:?usage: fresh.sh BUNDLE}
  outside
fi
