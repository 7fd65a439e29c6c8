// Tables that stay in flash on the AVR and are plain constants on a PC.
#pragma once
#include <stdint.h>

#ifdef __AVR__
#include <avr/pgmspace.h>
#else
#define PROGMEM
#define pgm_read_byte(at) (*(at))
#define pgm_read_word(at) (*(at))
#endif

namespace mrl {

inline uint8_t flash_byte(const uint8_t* at) { return pgm_read_byte(at); }
inline int8_t flash_int8(const int8_t* at) { return static_cast<int8_t>(pgm_read_byte(at)); }
inline char flash_char(const char* at) { return static_cast<char>(pgm_read_byte(at)); }
inline int16_t flash_int16(const int16_t* at) { return static_cast<int16_t>(pgm_read_word(at)); }
inline uint16_t flash_uint16(const uint16_t* at) { return pgm_read_word(at); }
template <typename T>
inline T* flash_pointer(T* const* at) {
  return reinterpret_cast<T*>(pgm_read_word(at));
}

}  // namespace mrl
