# The sketch with Debian's gcc-avr and arduino-core-avr, and the same C++ for the PC.  Included by the Makefile.
SHELL := /bin/bash
FW_SOURCE := firmware/mrl_firmware
FW_BUILD := build/firmware
ARDUINO_AVR ?= /usr/share/arduino/hardware/arduino/avr
AVRDUDE ?= avrdude
IMAGE ?= mrl_firmware

# The flags of the Arduino IDE, so that its binary is this one; the files that every frame passes ask for -O2 themselves.
FW_BOARD_uno := -mmcu=atmega328p -DARDUINO_AVR_UNO -I$(ARDUINO_AVR)/variants/standard
FW_BOARD_mega := -mmcu=atmega2560 -DARDUINO_AVR_MEGA2560 -I$(ARDUINO_AVR)/variants/mega
FW_MEMORY_uno := -v flash=32256 -v sram=2048
FW_MEMORY_mega := -v flash=253952 -v sram=8192
FW_LINK := -Os -g -flto -fuse-linker-plugin -Wl,--gc-sections
FW_FLAGS := -DF_CPU=16000000L -DARDUINO=10819 -DARDUINO_ARCH_AVR -Os -g -flto -ffunction-sections -fdata-sections \
  -I$(ARDUINO_AVR)/cores/arduino
FW_WARNINGS := -Wall -Wextra -Wconversion -Werror
FW_CXX := -std=gnu++11 -fno-exceptions -fno-threadsafe-statics

# Linked as the Arduino IDE does it; main(), pins, serial line and I2C are our own.
FW_CORE := hooks.c wiring.c main.cpp
FW_HEADERS := $(wildcard $(FW_SOURCE)/*.h $(FW_SOURCE)/src/*/*.h)
FW_CPP := $(sort $(wildcard $(FW_SOURCE)/src/*/*.cpp))
# A folder is newer than what was linked when one of its files has been removed.
FW_FOLDERS := $(wildcard $(FW_SOURCE)/src/*)
FW_PARTS := mrl_firmware.ino $(FW_CPP:$(FW_SOURCE)/%=%)

PC_BUILD := build/pc
PC_CXX := -std=gnu++11 -g -O1 -Wall -Wextra -Wconversion -Werror -I$(FW_SOURCE)
PC_SOURCES = $(filter-out %_avr.cpp,$(FW_CPP)) tests/firmware/hal_pc.cpp tests/firmware/hal_bridge_pc.cpp \
  tests/firmware/wheel_pc.cpp
PC_HEADERS := tests/firmware/hal_pc.h tests/firmware/hal_bridge_pc.h

.PHONY: firmware flash pc-firmware

# What the linker says, with the place of the function that a row of the table needs.
FW_MISSING := avr-c++filt | sed -E \
  -e 's|.*undefined reference to .mrl::sensors::([a-z0-9_]+)\(.*|\1() is missing, expected it in $(FW_SOURCE)/src/sensors/\1.cpp: firmware/SENSORS.md|' \
  -e 's|.*undefined reference to .mrl::handlers::([a-z0-9_]+)\(.*|\1() is missing, expected it in $(FW_SOURCE)/src: CONTRIBUTING.md, A command|'

# $(1) name of the image, $(2) its defines, $(3) its board
define FW_IMAGE
FW_IMAGES += $$(FW_BUILD)/$(1).elf
FW_OBJECTS_$(1) := $$(patsubst %,$$(FW_BUILD)/$(1).o/%.o,$$(FW_PARTS))

$$(FW_BUILD)/$(1).o/%.cpp.o: $$(FW_SOURCE)/%.cpp $$(FW_HEADERS) firmware/firmware.mk | apt
	@mkdir -p $$(@D)
	@echo "  $(1): $$(<F)"
	@avr-g++ $$(FW_BOARD_$(3)) $$(FW_FLAGS) $$(FW_CXX) $$(FW_WARNINGS) $(2) -c $$< -o $$@

$$(FW_BUILD)/$(1).o/%.ino.o: $$(FW_SOURCE)/%.ino $$(FW_HEADERS) firmware/firmware.mk | apt
	@mkdir -p $$(@D)
	@avr-g++ $$(FW_BOARD_$(3)) $$(FW_FLAGS) $$(FW_CXX) $$(FW_WARNINGS) $(2) -x c++ -include Arduino.h -c $$< -o $$@

$$(FW_BUILD)/$(1).elf: $$(FW_OBJECTS_$(1)) $$(FW_BUILD)/core_$(3)/core.a $$(FW_FOLDERS)
	@set -o pipefail; avr-gcc $$(FW_BOARD_$(3)) $(FW_LINK) $$(filter %.o %.a,$$^) -lm -o $$@.new 2>&1 | $(FW_MISSING) >&2
	@avr-objcopy -O ihex -R .eeprom $$@.new $$(FW_BUILD)/$(1).hex
	@mv $$@.new $$@
	@avr-size -B $$@ | awk $$(FW_MEMORY_$(3)) 'NR == 2 { printf "%-28s flash %5d of %d, SRAM %4d of %d bytes before the stack\n", \
	  "$(1)", $$$$1 + $$$$2, flash, $$$$2 + $$$$3, sram }'
endef
$(eval $(call FW_IMAGE,mrl_firmware,,uno))
$(eval $(call FW_IMAGE,mrl_firmware_environment,-DMRL_ENVIRONMENT=1,uno))
$(eval $(call FW_IMAGE,mrl_firmware_xbee,-DMRL_XBEE=1,uno))
$(eval $(call FW_IMAGE,mrl_firmware_hbridge,-DMRL_BRIDGE=1,uno))
$(eval $(call FW_IMAGE,mrl_firmware_hbridge_mega,-DMRL_BRIDGE=1,mega))
$(eval $(call FW_IMAGE,mrl_firmware_virtual,-DMRL_BRIDGE=1 -DMRL_VIRTUAL=1,uno))
$(eval $(call FW_IMAGE,mrl_firmware_virtual_mega,-DMRL_BRIDGE=1 -DMRL_VIRTUAL=1,mega))

# The core's files belong to a package that `apt` may install while make runs.  A rule that names them would let make
# delete them afterwards, as files of its own making, so no rule here names a file outside the checkout.
# $(1) the board
define FW_CORE_OF
$$(FW_BUILD)/core_$(1)/%.o: firmware/firmware.mk | apt
	@mkdir -p $$(@D)
	@[ -f "$$(ARDUINO_AVR)/cores/arduino/$$*" ] || \
	  { echo "no Arduino core in $$(ARDUINO_AVR): apt-get install arduino-core-avr, or set ARDUINO_AVR" >&2; exit 1; }
	@$$(if $$(filter %.c,$$*),avr-gcc,avr-g++ $$(FW_CXX)) $$(FW_BOARD_$(1)) $$(FW_FLAGS) -w \
	  -c "$$(ARDUINO_AVR)/cores/arduino/$$*" -o $$@

$$(FW_BUILD)/core_$(1)/core.a: $$(FW_CORE:%=$$(FW_BUILD)/core_$(1)/%.o)
	@rm -f $$@ && avr-gcc-ar rcs $$@ $$^
endef
$(eval $(call FW_CORE_OF,uno))
$(eval $(call FW_CORE_OF,mega))

firmware: $(FW_IMAGES) ## Build the sketch (sonar, environment-sensor, radio and H-bridge boards)

flash: ## Upload to an Arduino Uno: PORT=/dev/ttyACM0, IMAGE=mrl_firmware_environment for another board
	@[ -n "$(PORT)" ] || { echo "make flash: which port? make flash PORT=/dev/ttyACM0" >&2; exit 1; }
	@[ -c "$(PORT)" ] || { echo "make flash: no board at $(PORT): no such serial port" >&2; exit 1; }
	@$(MAKE) --no-print-directory $(FW_BUILD)/$(IMAGE).elf
	@out=$$($(AVRDUDE) -q -q -p m328p -c arduino -b 115200 -P "$(PORT)" -D \
	  -U flash:w:$(FW_BUILD)/$(IMAGE).hex:i 2>&1) || \
	  { echo "make flash: no board answers at $(PORT): $$(echo "$$out" | grep . | head -1)" >&2; exit 1; }

PC_LIBRARIES := $(patsubst %,$(PC_BUILD)/libmrl_firmware%.so,_xbee _environment _hbridge _hbridge_mega _virtual) $(PC_BUILD)/libmrl_firmware.so

$(PC_BUILD)/libmrl_firmware_environment.so: PC_DEFINES := -DMRL_ENVIRONMENT=1
$(PC_BUILD)/libmrl_firmware_xbee.so: PC_DEFINES := -DMRL_XBEE=1
$(PC_BUILD)/libmrl_firmware_hbridge.so: PC_DEFINES := -DMRL_BRIDGE=1
$(PC_BUILD)/libmrl_firmware_virtual.so: PC_DEFINES := -DMRL_BRIDGE=1 -DMRL_VIRTUAL=1
$(PC_BUILD)/libmrl_firmware_hbridge_mega.so: PC_DEFINES := -DMRL_BRIDGE=1 -DMRL_MEGA=1
$(PC_LIBRARIES): $(PC_SOURCES) $(FW_FOLDERS) $(FW_HEADERS) $(PC_HEADERS) firmware/firmware.mk | apt
	@mkdir -p $(@D)
	@g++ $(PC_CXX) $(PC_DEFINES) -shared -fPIC $(PC_SOURCES) -o $@.new && mv $@.new $@

# libFuzzer looks for inputs and stops at undefined behaviour; what it keeps is then tried under gcc's address and
# undefined-behaviour sanitizers.
FUZZ_SOURCES = $(PC_SOURCES) tests/firmware/fuzz.cpp
FUZZ_NEEDS = $(FW_HEADERS) $(PC_HEADERS) firmware/firmware.mk
vpath %.cpp $(FW_FOLDERS) tests/firmware

# $(1) what is behind the name of the image, $(2) its defines
define FUZZ_IMAGE
FUZZERS += $$(PC_BUILD)/fuzz_firmware$(1) $$(PC_BUILD)/checked_firmware$(1)

$$(PC_BUILD)/fuzz$(1).o/%.o: %.cpp $$(FUZZ_NEEDS) | apt
	@mkdir -p $$(@D)
	@clang++ $$(PC_CXX) $(2) -fsanitize=fuzzer-no-link,undefined -fsanitize-trap=undefined -c $$< -o $$@

$$(PC_BUILD)/fuzz_firmware$(1): $$(patsubst %.cpp,$$(PC_BUILD)/fuzz$(1).o/%.o,$$(notdir $$(FUZZ_SOURCES))) $$(FW_FOLDERS)
	@clang++ -fsanitize=fuzzer $$(filter %.o,$$^) -o $$@.new && mv $$@.new $$@

$$(PC_BUILD)/checked_firmware$(1): $$(FUZZ_SOURCES) $$(FW_FOLDERS) $$(FUZZ_NEEDS) tests/firmware/replay.cpp | apt
	@mkdir -p $$(@D)
	@g++ $$(PC_CXX) $(2) -fsanitize=address,undefined -fno-sanitize-recover=all $$(FUZZ_SOURCES) \
	  tests/firmware/replay.cpp -o $$@.new && mv $$@.new $$@
endef
$(eval $(call FUZZ_IMAGE,,))
$(eval $(call FUZZ_IMAGE,_hbridge,-DMRL_BRIDGE=1))

pc-firmware: $(PC_LIBRARIES) $(FUZZERS) ## Build the same C++ for tests on the PC
