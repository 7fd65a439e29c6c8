#include "board.h"

#include "answers.h"
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
  failsafe::begin();
}

void run() {
  hal::watchdog_kick();
  failsafe::service(board_clock::update());
  commands::receive();
  motor::service();
  bus::service();
  answers::service();
  sonar::service();
  environment::service();
  config::service();
  status::service();
}

}  // namespace board
}  // namespace mrl
