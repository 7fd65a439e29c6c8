#include "config.h"

#include <string.h>

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
#if MRL_BRIDGE
const Range RANGES[] PROGMEM = {MRL_PARAMETERS(RANGE) MRL_PINS(RANGE)};
#else
const Range RANGES[] PROGMEM = {MRL_PARAMETERS(RANGE)};
#endif
constexpr uint8_t VALUES = sizeof RANGES / sizeof(Range);

struct Model {
  int16_t first_id, last_id, values[MODEL_PARAMETER_COUNT];
};

#define MODEL(first, last, ...) {first, last, {__VA_ARGS__}},
const Model MODELS[] PROGMEM = {MRL_MODELS(MODEL)};
constexpr uint8_t MODEL_COUNT = sizeof MODELS / sizeof(Model);

const int16_t COMMON[] PROGMEM = {MRL_COMMON_DEFAULTS};
constexpr uint8_t COMMON_FIRST = MODEL_PARAMETER_FIRST + MODEL_PARAMETER_COUNT;
static_assert(COMMON_FIRST + sizeof COMMON / sizeof(int16_t) == PARAMETER_COUNT, "each parameter has a default");
static_assert(sizeof(float) == 4, "the id of 2013 is a 4-byte float");

constexpr uint8_t ID_SIZE = 4;
constexpr uint8_t SETTINGS_SIZE = ID_SIZE + BLOCK_SIZE;
constexpr uint8_t IMAGE_SIZE = SETTINGS_SIZE + (MRL_BRIDGE ? PINS_SIZE : 0);
static_assert(BLOCK_AT + BLOCK_SIZE <= PINS_AT, "the blocks stand one behind the other");

int16_t values[VALUES];
uint8_t saving;  // index in the image that is written next
enum class Step : uint8_t { idle, writing } step;

bool allowed(uint8_t index, int16_t value) {
  return value >= flash_int16(&RANGES[index].low) && value <= flash_int16(&RANGES[index].high);
}

int16_t& id() { return values[static_cast<uint8_t>(Parameter::robot_id)]; }

const Model* model_of(int16_t robot_id) {
  for (uint8_t i = 0; i < MODEL_COUNT; i++) {
    if (robot_id >= flash_int16(&MODELS[i].first_id) && robot_id <= flash_int16(&MODELS[i].last_id)) return &MODELS[i];
  }
  return &MODELS[0];
}

void take_defaults() {
  const Model* model = model_of(id());
  for (uint8_t i = 0; i < MODEL_PARAMETER_COUNT; i++) values[MODEL_PARAMETER_FIRST + i] = flash_int16(&model->values[i]);
  for (uint8_t i = COMMON_FIRST; i < PARAMETER_COUNT; i++) values[i] = flash_int16(&COMMON[i - COMMON_FIRST]);
}

// ---- the image: the contents of the EEPROM, byte by byte

uint16_t address_of(uint8_t place) {
  if (MRL_BRIDGE && place >= SETTINGS_SIZE) return static_cast<uint16_t>(PINS_AT + place - SETTINGS_SIZE);
  return place < ID_SIZE ? static_cast<uint16_t>(ID_AT + place) : static_cast<uint16_t>(BLOCK_AT + place - ID_SIZE);
}

uint8_t id_byte(uint8_t place) {
  const float number = id();
  uint8_t bytes[ID_SIZE];
  memcpy(bytes, &number, ID_SIZE);
  return bytes[place];
}

uint8_t body_byte(uint8_t place) {
  if (!place) return LAYOUT;
  const uint16_t value = static_cast<uint16_t>(values[(place - 1) / 2]);
  return static_cast<uint8_t>((place - 1) % 2 ? value >> 8 : value);
}

uint16_t body_crc() {
  uint16_t crc = CRC_START;
  for (uint8_t place = 0; place < BLOCK_SIZE - 2; place++) crc = crc_update(crc, body_byte(place));
  return crc;
}

uint8_t pins_byte(uint8_t place) {
  if (!place) return PINS_LAYOUT;
  if (place <= PIN_COUNT) return static_cast<uint8_t>(values[PIN_FIRST + place - 1]);
  uint16_t crc = CRC_START;
  for (uint8_t i = 0; i <= PIN_COUNT; i++) crc = crc_update(crc, pins_byte(i));
  return static_cast<uint8_t>(place < PINS_SIZE - 1 ? crc : crc >> 8);
}

uint8_t image_byte(uint8_t place) {
  if (place < ID_SIZE) return id_byte(place);
  if (place < SETTINGS_SIZE - 2) return body_byte(static_cast<uint8_t>(place - ID_SIZE));
  if (MRL_BRIDGE && place >= SETTINGS_SIZE) return pins_byte(static_cast<uint8_t>(place - SETTINGS_SIZE));
  const uint16_t crc = body_crc();
  return static_cast<uint8_t>(place < SETTINGS_SIZE - 1 ? crc : crc >> 8);
}

// Whether the first bytes of the EEPROM are those of the image.
bool matches_image(uint8_t size) {
  for (uint8_t place = 0; place < size; place++) {
    if (hal::eeprom_read(address_of(place)) != image_byte(place)) return false;
  }
  return true;
}

// ---- loading

// The id of 2013, or 0 if the float is not an id (a blank EEPROM reads as NaN).
int16_t read_id() {
  uint8_t bytes[ID_SIZE];
  float number;
  for (uint8_t i = 0; i < ID_SIZE; i++) bytes[i] = hal::eeprom_read(static_cast<uint16_t>(ID_AT + i));
  memcpy(&number, bytes, ID_SIZE);
  if (!(number >= 1.0f && number <= 32767.0f)) return 0;
  const int16_t whole = static_cast<int16_t>(number);
  return static_cast<float>(whole) == number ? whole : static_cast<int16_t>(0);
}

// Loads the block; false if it has another layout or is damaged, and then the values are not to be used.
bool read_block() {
  bool good = hal::eeprom_read(BLOCK_AT) == LAYOUT;
  uint16_t crc = crc_update(CRC_START, LAYOUT), at = BLOCK_AT + 1;
  const auto next = [&] {
    const uint8_t byte = hal::eeprom_read(at++);
    crc = crc_update(crc, byte);
    return byte;
  };
  for (uint8_t i = 0; i < PARAMETER_COUNT; i++) {
    const uint8_t low = next();
    values[i] = static_cast<int16_t>(low | next() << 8);
    good = good && allowed(i, values[i]);
  }
  return good && hal::eeprom_read(at) == (crc & 0xFF) && hal::eeprom_read(at + 1) == crc >> 8;
}

#if MRL_BRIDGE
// Loads the wiring, which is that of a board without wires if the block is missing or damaged.
void read_pins() {
  bool good = true;
  for (uint8_t i = 0; i < PIN_COUNT; i++) {
    const uint8_t index = static_cast<uint8_t>(PIN_FIRST + i);
    values[index] = static_cast<int8_t>(hal::eeprom_read(static_cast<uint16_t>(PINS_AT + 1 + i)));
    good = good && allowed(index, values[index]);
  }
  for (uint8_t place = SETTINGS_SIZE; place < IMAGE_SIZE; place++) {
    good = good && hal::eeprom_read(address_of(place)) == image_byte(place);
  }
  if (good) return;
  for (uint8_t index = PIN_FIRST; index < VALUES; index++) {
    const int16_t low = flash_int16(&RANGES[index].low);
    values[index] = low > NOT_CONNECTED ? low : NOT_CONNECTED;
  }
}
#endif

void apply() {
  status::set_fault(FAULT_ID_UNSET, !id());
  commands::decoder.plain_calibrate = get(Parameter::plain_calibrate);
  bus::configure();
  sonar::configure();
  // A running save starts again; otherwise it would mix old and new values.
  saving = 0;
}

}  // namespace

// The id in a block with a correct checksum is more reliable than the float.  If they differ, one was damaged or
// changed by another firmware, and neither the calibration nor the ceilings can be trusted.
void begin() {
  const bool good = read_block();
  if (!good) id() = read_id();
  const bool sound = good && matches_image(ID_SIZE);
  if (!sound) take_defaults();
  status::set_fault(FAULT_EEPROM, !sound);
#if MRL_BRIDGE
  read_pins();
#endif
  apply();
}

#if MRL_BRIDGE
const int16_t* pins() { return values + PIN_FIRST; }
#endif

int16_t get(Parameter parameter) { return values[static_cast<uint8_t>(parameter)]; }

void set(Parameter parameter, int16_t value) { values[static_cast<uint8_t>(parameter)] = value; }

void service() {
  if (step == Step::idle || !hal::eeprom_ready()) return;
  board_clock::stay_awake();
  if (saving < IMAGE_SIZE) {
    const uint8_t byte = image_byte(saving);
    if (hal::eeprom_read(address_of(saving)) != byte) hal::eeprom_write(address_of(saving), byte);
    saving++;
    return;
  }
  step = Step::idle;
  const bool saved = matches_image(IMAGE_SIZE);
  status::set_fault(FAULT_EEPROM, !saved);
  answers::ask(SAVE_CONFIG, saved);
}

void report(int16_t index) {
  writer::add(index);
  writer::add(values[index]);
}

}  // namespace config

namespace handlers {

void read_config(const int16_t* args, uint8_t) { answers::ask(READ_CONFIG, args[0]); }

void write_config(const int16_t* args, uint8_t) {
  const uint8_t index = static_cast<uint8_t>(args[0]);
  if (!config::allowed(index, args[1])) return status::refuse(Reason::argument_range);
  config::values[index] = args[1];
  config::apply();
  motor::refresh(static_cast<Parameter>(index));
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
