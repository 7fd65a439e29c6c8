// CRC-16 with polynomial 0x1021, unreflected; start with CRC_START (CRC-16/IBM-3740).
#pragma once
#include <stdint.h>

#ifdef __AVR__
#include <util/crc16.h>
#endif

namespace mrl {

constexpr uint16_t CRC_START = 0xFFFF;

#ifdef __AVR__
inline uint16_t crc_update(uint16_t crc, uint8_t byte) { return _crc_xmodem_update(crc, byte); }
#else
inline uint16_t crc_update(uint16_t crc, uint8_t byte) {
  crc = static_cast<uint16_t>(crc ^ (byte << 8));
  for (int bit = 0; bit < 8; bit++) {
    crc = static_cast<uint16_t>((crc & 0x8000) ? (crc << 1) ^ 0x1021 : crc << 1);
  }
  return crc;
}
#endif

}  // namespace mrl
