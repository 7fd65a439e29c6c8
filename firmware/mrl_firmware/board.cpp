#include "board.h"

#include "answers.h"
#include "baud.h"
#include "board_clock.h"
#include "bus.h"
#include "commands.h"
#include "config.h"
#include "environment.h"
#include "failsafe.h"
#include "hal.h"
#include "motor_board.h"
#include "sonar.h"
#include "status.h"
#include "xbee.h"

namespace mrl {
namespace board {

void begin() {
  hal::begin();
  board_clock::begin();
  status::begin();
  sonar::begin();
  environment::begin();
  config::begin();
  motor::begin();
  xbee::begin();
}

namespace {

void (*const IN_TURN[])() = {motor::service,  bus::service_background, sonar::service, environment::service,
                             config::service, status::service,         xbee::service};
constexpr uint8_t TURNS = sizeof IN_TURN / sizeof IN_TURN[0];
uint8_t turn;

}  // namespace

// Tasks that depend only on time take turns, one at each tick of the clock.  This keeps each pass short: new bytes and
// ended transfers are found soon, and an answer begins within microseconds.
void run() {
  const uint16_t gap = board_clock::update();
  if (gap) {
    hal::watchdog_kick();
    failsafe::service(gap);
    baud::service();
  }
  commands::receive();
  bus::service();
  answers::service();
  if (!gap) return;
  IN_TURN[turn]();
  turn = static_cast<uint8_t>((turn + 1) % TURNS);
}

}  // namespace board
}  // namespace mrl
