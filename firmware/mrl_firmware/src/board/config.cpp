#include "config.h"

#include <stddef.h>

#include "../serial/answers.h"
#include "board_clock.h"
#include "bus.h"
#include "../serial/commands.h"
#include "../serial/crc.h"
#include "../hal/flash.h"
#include "../serial/frame_writer.h"
#include "../hal/hal.h"
#include "../motors/motor.h"
#include "../sensors/sonar.h"
#include "status.h"

namespace mrl {
namespace config {
namespace {

struct Range {
  int16_t low, high;
};

#define RANGE(number, name, low, high) {low, high},
const Range RANGES[] PROGMEM = {MRL_PARAMETERS(RANGE)};

#if MRL_BRIDGE
struct PinRange {
  int8_t low, high;
};
const PinRange PIN_RANGES[] PROGMEM = {MRL_PINS(RANGE)
#if MRL_MEGA
                                           MRL_MEGA_PINS(RANGE)
#endif
};
#endif

struct Model {
  int16_t first_id, last_id, values[MODEL_PARAMETER_COUNT];
};

#define MODEL(first, last, ...) {first, last, {__VA_ARGS__}},
const Model MODELS[] PROGMEM = {MRL_MODELS(MODEL)};
constexpr uint8_t MODEL_COUNT = sizeof MODELS / sizeof(Model);

const int16_t COMMON[] PROGMEM = {MRL_COMMON_DEFAULTS};
constexpr uint8_t COMMON_FIRST = MODEL_PARAMETER_FIRST + MODEL_PARAMETER_COUNT;
static_assert(COMMON_FIRST + sizeof COMMON / sizeof(int16_t) == PARAMETER_COUNT, "each parameter has a default");

// What the EEPROM holds, byte by byte; id and checksums are set when it is saved.
struct __attribute__((packed)) Image {
  uint32_t id;
  uint8_t layout;
  int16_t values[PARAMETER_COUNT];
  uint16_t crc;
#if MRL_BRIDGE
  uint8_t pins_layout;
  int8_t pins[PIN_COUNT];
  uint16_t pins_crc;
#endif
};
Image image;
uint8_t* const bytes = reinterpret_cast<uint8_t*>(&image);

constexpr uint8_t BLOCK = offsetof(Image, layout), PINS = BLOCK + BLOCK_SIZE;
// The checksum of the wiring covers that of the block: after a cut between the two, neither fits the other.
constexpr uint8_t CHAIN = offsetof(Image, crc);
static_assert(CHAIN + 2 == PINS && BLOCK_AT + BLOCK_SIZE <= PINS_AT, "the blocks stand one behind the other");

uint8_t saving;  // index in the image that is written next
enum class Step : uint8_t { idle, writing } step;

bool allowed(uint8_t index, int16_t value) {
#if MRL_BRIDGE
  if (index >= PIN_FIRST) {
    const PinRange& range = PIN_RANGES[index - PIN_FIRST];
    return value >= flash_int8(&range.low) && value <= flash_int8(&range.high);
  }
#endif
  return value >= flash_int16(&RANGES[index].low) && value <= flash_int16(&RANGES[index].high);
}

int16_t id() { return get(Parameter::robot_id); }

const Model* model_of(int16_t robot_id) {
  for (uint8_t i = 0; i < MODEL_COUNT; i++) {
    if (robot_id >= flash_int16(&MODELS[i].first_id) && robot_id <= flash_int16(&MODELS[i].last_id)) return &MODELS[i];
  }
  return &MODELS[0];
}

void take_defaults() {
  const Model* model = model_of(id());
  for (uint8_t i = 0; i < MODEL_PARAMETER_COUNT; i++) image.values[MODEL_PARAMETER_FIRST + i] = flash_int16(&model->values[i]);
  for (uint8_t i = COMMON_FIRST; i < PARAMETER_COUNT; i++) image.values[i] = flash_int16(&COMMON[i - COMMON_FIRST]);
}

// ---- the image

uint16_t address_of(uint8_t place) {
  if (place >= PINS) return static_cast<uint16_t>(PINS_AT + place - PINS);
  return static_cast<uint16_t>(place < BLOCK ? ID_AT + place : BLOCK_AT + place - BLOCK);
}

uint16_t crc_of(uint8_t from, uint8_t to) {
  uint16_t crc = CRC_START;
  for (; from < to; from++) crc = crc_update(crc, bytes[from]);
  return crc;
}

// The id of 2013 is a float of 4 bytes: an exponent, and 23 bits behind the leading one.
constexpr uint8_t FLOAT_BITS = 23, EXPONENT_OF_1 = 127;
constexpr uint32_t LEADING_ONE = 1UL << FLOAT_BITS;

uint32_t float_of(int16_t positive) {
  if (!positive) return 0;
  uint32_t bits = static_cast<uint32_t>(positive);
  uint8_t exponent = EXPONENT_OF_1 + FLOAT_BITS;
  for (; bits < LEADING_ONE; bits <<= 1) exponent--;
  return bits - LEADING_ONE + (static_cast<uint32_t>(exponent) << FLOAT_BITS);
}

void seal() {
  image.id = float_of(id());
  image.layout = LAYOUT;
  image.crc = crc_of(BLOCK, offsetof(Image, crc));
#if MRL_BRIDGE
  image.pins_layout = PINS_LAYOUT;
  image.pins_crc = crc_of(CHAIN, offsetof(Image, pins_crc));
#endif
}

bool is_saved() {
  for (uint8_t place = 0; place < sizeof image; place++) {
    if (hal::eeprom_read(address_of(place)) != bytes[place]) return false;
  }
  return true;
}

// ---- loading

// The id of 2013, or 0 if the float is not an id (a blank EEPROM reads as NaN).
int16_t id_of(uint32_t bits) {
  const uint32_t fraction = (bits & (LEADING_ONE - 1)) | LEADING_ONE;
  const uint16_t places = static_cast<uint16_t>(EXPONENT_OF_1 + FLOAT_BITS - (bits >> FLOAT_BITS));
  if (places > FLOAT_BITS || places < FLOAT_BITS - 14) return 0;
  const int16_t whole = static_cast<int16_t>(fraction >> places);
  return float_of(whole) == bits ? whole : static_cast<int16_t>(0);
}

// False if the block has another layout or is damaged, and then its values are not to be used.
bool block_is_good() {
  if (image.layout != LAYOUT || image.crc != crc_of(BLOCK, offsetof(Image, crc))) return false;
  for (uint8_t i = 0; i < PARAMETER_COUNT; i++) {
    if (!allowed(i, image.values[i])) return false;
  }
  return true;
}

#if MRL_BRIDGE
bool pins_are_good() {
  if (image.pins_layout != PINS_LAYOUT || image.pins_crc != crc_of(CHAIN, offsetof(Image, pins_crc))) return false;
  for (uint8_t i = 0; i < PIN_COUNT; i++) {
    if (!allowed(static_cast<uint8_t>(PIN_FIRST + i), image.pins[i])) return false;
  }
  return true;
}

// If the wiring is missing or damaged, it is that of a board without wires.
void check_pins() {
  if (pins_are_good()) return;
  for (uint8_t i = 0; i < PIN_COUNT; i++) {
    const bool is_pin = allowed(static_cast<uint8_t>(PIN_FIRST + i), NOT_CONNECTED);
    image.pins[i] = is_pin ? static_cast<int8_t>(NOT_CONNECTED) : static_cast<int8_t>(0);
  }
}
#endif

void apply() {
  status::set_fault(FAULT_ID_UNSET, !id());
  commands::decoder.plain_calibrate = get(Parameter::plain_calibrate);
  bus::configure();
  sonar::configure();
  saving = 0;  // of defaults; see set()
}

}  // namespace

// The id in a block with a correct checksum is more reliable than the float.  If they differ, one was damaged or
// changed by another firmware, and neither the calibration nor the ceilings can be trusted.
void begin() {
  for (uint8_t place = 0; place < sizeof image; place++) bytes[place] = hal::eeprom_read(address_of(place));
  const bool good = block_is_good();
  if (!good) set(Parameter::robot_id, id_of(image.id));
  const bool sound = good && image.id == float_of(id());
  if (!sound) take_defaults();
  status::set_fault(FAULT_EEPROM, !sound);
#if MRL_BRIDGE
  check_pins();
#endif
  apply();
}

#if MRL_BRIDGE
const int8_t* pins() { return image.pins; }
#endif

int16_t get(Parameter parameter) {
  const uint8_t index = static_cast<uint8_t>(parameter);
#if MRL_BRIDGE
  if (index >= PIN_FIRST) return image.pins[index - PIN_FIRST];
#endif
  return image.values[index];
}

// A running save starts again; otherwise it would mix old and new values.
void set(Parameter parameter, int16_t value) {
  saving = 0;
  const uint8_t index = static_cast<uint8_t>(parameter);
#if MRL_BRIDGE
  if (index >= PIN_FIRST) {
    image.pins[index - PIN_FIRST] = static_cast<int8_t>(value);
    return;
  }
#endif
  image.values[index] = value;
}

void service() {
  if (step == Step::idle || !hal::eeprom_ready()) return;
  board_clock::stay_awake();
  if (!saving) seal();
  if (saving < sizeof image) {
    const uint16_t address = address_of(saving);
    const uint8_t byte = bytes[saving++];
    if (hal::eeprom_read(address) != byte) hal::eeprom_write(address, byte);
    return;
  }
  step = Step::idle;
  const bool saved = is_saved();
  status::set_fault(FAULT_EEPROM, !saved);
  answers::ask(SAVE_CONFIG, saved);
}

void report(int16_t index) {
  writer::add(index);
  writer::add(get(static_cast<Parameter>(index)));
}

}  // namespace config

namespace handlers {

void read_config(const int16_t* args, uint8_t) { answers::ask(READ_CONFIG, args[0]); }

void write_config(const int16_t* args, uint8_t) {
  const uint8_t index = static_cast<uint8_t>(args[0]);
  if (!config::allowed(index, args[1])) return status::refuse(Reason::argument_range);
  const Parameter parameter = static_cast<Parameter>(index);
  config::set(parameter, args[1]);
  config::apply();
  motor::refresh(parameter);
  answers::ask(WRITE_CONFIG, args[0]);
}

void save_config(const int16_t*, uint8_t) {
  config::saving = 0;
  config::step = config::Step::writing;
}

void default_config(const int16_t*, uint8_t) {
  config::take_defaults();
  config::apply();
  motor::refresh_all();
  answers::ask(DEFAULT_CONFIG, 1);
}

}  // namespace handlers
}  // namespace mrl
