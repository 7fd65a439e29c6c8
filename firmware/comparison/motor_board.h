// The OMNI-3MD as both comparison sketches read it: Arduino's Wire at its 100 kbit/s, and a transfer for each value.
#pragma once

#include <Arduino.h>
#include <Wire.h>

namespace motor_board {

constexpr uint8_t ADDRESS = 0x18, LEFT = 0xD8, RIGHT = 0xD6;

// A register of two bytes, high byte first.
inline int16_t value(uint8_t number) {
  Wire.beginTransmission(ADDRESS);
  Wire.write(number);
  Wire.endTransmission();
  Wire.requestFrom(ADDRESS, static_cast<uint8_t>(2));
  const int high = Wire.read();
  const int low = Wire.read();
  return static_cast<int16_t>((high << 8) | (low & 0xFF));
}

}  // namespace motor_board
