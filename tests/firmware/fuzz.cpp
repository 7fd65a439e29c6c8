// libFuzzer's entry: bytes on the line, amid faults of the bus, must never leave memory, stop the loop, or let it oversleep.
#include <stddef.h>
#include <stdlib.h>

#include "hal_pc.h"
#include "src/board/wiring.h"

namespace {

uint32_t noise = 1;
bool absent;

// xorshift: the world's answers differ from run to run of the loop, but not from run to run of the program.
uint8_t random_byte() {
  noise ^= noise << 13;
  noise ^= noise >> 17;
  noise ^= noise << 5;
  return static_cast<uint8_t>(noise);
}

// Most of the time an IMU answers as it should.
constexpr uint8_t WHO_AM_I = 0x75, MPU_6050 = 0x68, GYRO_CONFIG = 0x1B, GYRO_SCALE = 0x08;
uint8_t pointer;

int write(uint8_t, const uint8_t* data, int, double) {
  pointer = data[0];
  return !absent;
}

int read(uint8_t, uint8_t* data, int count, double) {
  for (int i = 0; i < count; i++) data[i] = random_byte();
  const bool odd = !(random_byte() & 0x1F);
  if (pointer == WHO_AM_I && !odd) data[0] = MPU_6050;
  if (pointer == GYRO_CONFIG && !odd) data[0] = GYRO_SCALE;
  return !absent;
}

int adc(int, double) { return random_byte() * 4 + 3; }

void pin(int, int, double) {}

// Lines of the encoders go to and fro, as those of turning wheels, open wires and oscillations.
void move_encoders() {
#if MRL_MEGA
  static const int pins[] = {62, 63, 64, 65, 66, 67, 68, 69};
#else
  static const int pins[] = {2, 4, 8, 10};
#endif
  double time_us = pc_now_us();
  for (int count = random_byte(); count; count--) {
    const uint8_t which = random_byte();
    time_us += which >> 4;
    pc_edge(pins[which % (sizeof pins / sizeof *pins)], which >> 3 & 1, time_us);
  }
}

void wait(double us) {
  pc_advance(pc_now_us() + us);
  uint8_t out[256];
  while (pc_sent(out, sizeof out)) {
  }
  if (pc_slept_too_long()) abort();
}

// A board with an H-bridge moves only if it knows its wiring: parameters from the first pin on, of four wheels with two
// servos and a range sensor, or of a duo.
#if MRL_BRIDGE
#if MRL_MEGA
constexpr int8_t WIRES[] = {6,  22, 23, 7,  24, 25, 62, 63, 64, 65, 55, -1, -1, -1, -1, 54, -1, -1, 1, 2,
                            -1, 0,  0,  -1, -1, -1, -1, -1, -1, 0,  0,  -1, -1, -1, -1, -1, -1, 20, 8, 26,
                            27, 46, 28, 29, 66, 67, 68, 69, 3,  -1, -1, -1, 31, 10};
#else
constexpr int8_t WIRES[] = {5, 6, 7, 11, 3, 9, 2, 4, 8, 10, 14, 15, 16, 12, 13, 17, -1, -1, 1};
#endif

void set(int parameter, int value) {
  const int16_t args[] = {static_cast<int16_t>(parameter), static_cast<int16_t>(value)};
  mrl::handlers::write_config(args, 2);
}

void wire() {
  int next = static_cast<int>(mrl::Parameter::pin_left_pwm_a);
  for (int8_t pin : WIRES) set(next++, pin);
  set(static_cast<int>(mrl::Parameter::wiring), mrl::WIRING_SET);
  set(static_cast<int>(mrl::Parameter::bridge), static_cast<int>(mrl::Bridge::tb6612));
  wait(20000);
  if (!mrl::wiring::accepted()) abort();
}
#else
void wire() {}
#endif

bool start() {
  static const PcWorld world = {write, read, adc, pin, nullptr, nullptr, nullptr, nullptr};
  static uint8_t eeprom[1024];
  pc_start(&world, 0, 0, PC_POWER_ON, eeprom);
  wire();
  return true;
}

// Bytes from 0xF0 on are events of the world, not of the line.
void step(uint8_t byte) {
  switch (byte) {
    case 0xF0:
      absent = !absent;
      break;
    case 0xF1:
      pc_hang_bus(1, 3);
      break;
    case 0xF2:
      wait(20000);
      break;
    case 0xF3:
      pc_stall(pc_now_us() + 300000);
      break;
    case 0xF4:
      wait(500);
      break;
    case 0xF5:
      move_encoders();
      break;
    default:
      pc_receive(byte);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const bool started = start();
  (void)started;
  for (size_t i = 0; i < size; i++) {
    step(data[i]);
    wait(64);
  }
  wait(2000);
  return 0;
}
