# Sketches to compare the firmware with: the same compiler, and Arduino's own Serial and Wire.  Not part of the product.
COMPARE_SOURCE := firmware/comparison
COMPARE_BUILD := build/comparison
COMPARE_LIBRARIES ?= $(ARDUINO_AVR)/libraries
# -Os as the Arduino IDE; WString.cpp of core 1.8.7 needs DECIMAL_DIG with gcc 5.4.
COMPARE_FLAGS := $(FW_BOARD_uno) $(FW_FLAGS) -I$(COMPARE_LIBRARIES)/Wire/src -DDECIMAL_DIG=__DECIMAL_DIG__
COMPARE_CORE := main.cpp hooks.c wiring.c wiring_analog.c wiring_digital.c abi.cpp new.cpp Print.cpp Stream.cpp \
  WString.cpp HardwareSerial.cpp HardwareSerial0.cpp
COMPARE_WIRE := Wire.cpp utility/twi.c

.PHONY: comparison

# $(1) flags of the C++ standard for a C++ file
COMPARE_COMPILER = $(if $(filter %.c,$(1)),avr-gcc,avr-g++ $(FW_CXX)) $(COMPARE_FLAGS)

$(COMPARE_BUILD)/core/%.o: firmware/comparison.mk | apt
	@mkdir -p $(@D)
	@$(call COMPARE_COMPILER,$*) -w -c "$(ARDUINO_AVR)/cores/arduino/$*" -o $@

$(COMPARE_BUILD)/wire/%.o: firmware/comparison.mk | apt
	@mkdir -p $(@D)
	@$(call COMPARE_COMPILER,$*) -w -c "$(COMPARE_LIBRARIES)/Wire/src/$*" -o $@

# $(1) name of the image, $(2) its source, $(3) its defines
define COMPARE_IMAGE
COMPARE_IMAGES += $$(COMPARE_BUILD)/$(1).elf

$$(COMPARE_BUILD)/$(1).elf: $$(COMPARE_SOURCE)/$(2).cpp $$(COMPARE_SOURCE)/motor_board.h \
  $$(patsubst %,$$(COMPARE_BUILD)/core/%.o,$$(COMPARE_CORE)) $$(patsubst %,$$(COMPARE_BUILD)/wire/%.o,$$(COMPARE_WIRE))
	@avr-g++ $$(FW_CXX) $$(COMPARE_FLAGS) $$(FW_WARNINGS) -isystem $$(COMPARE_LIBRARIES)/Wire/src $(3) -c $$< -o $$@.o
	@avr-gcc $$(COMPARE_FLAGS) -fuse-linker-plugin -Wl,--gc-sections $$@.o $$(filter %.o,$$^) -o $$@.new
	@mv $$@.new $$@
endef
$(eval $(call COMPARE_IMAGE,timing_2013,timing_2013,))
$(eval $(call COMPARE_IMAGE,rosserial_57600,rosserial_protocol,-DROSSERIAL_BAUD=57600))
$(eval $(call COMPARE_IMAGE,rosserial_115200,rosserial_protocol,-DROSSERIAL_BAUD=115200))

comparison: $(COMPARE_IMAGES) ## Build the sketches that the firmware is compared with; build/comparison
