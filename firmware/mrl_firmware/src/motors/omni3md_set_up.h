// The settings for the motor board from the configuration, in parts that are sent one by one.
#pragma once
#include <stdint.h>

#include "omni3md_message.h"
#include "../serial/protocol.h"

namespace mrl {
namespace motor {

enum SetUp : uint8_t { SET_GEOMETRY = 1, SET_GAINS = 2, SET_RAMP = 4, SET_TIMEOUT = 8, SET_ALL = 15 };

Message set_up_message(uint8_t part);
// The part that a parameter belongs to, or 0.
uint8_t set_up_part(Parameter parameter);

}  // namespace motor
}  // namespace mrl
