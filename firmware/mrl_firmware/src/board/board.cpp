#include "../hal/fast.h"
#include "../../build.h"
#include "board.h"

#include "../serial/answers.h"
#include "../sensors/battery.h"
#include "../serial/baud.h"
#include "board_clock.h"
#include "bus.h"
#include "../serial/commands.h"
#include "config.h"
#include "../sensors/environment.h"
#include "failsafe.h"
#include "../hal/hal.h"
#include "../motors/motor.h"
#include "../motors/servo.h"
#include "../sensors/ranges.h"
#include "../sensors/sensors.h"
#include "../sensors/sonar.h"
#include "status.h"
#include "../radio/xbee.h"

namespace mrl {
namespace board {

void begin() {
  hal::begin();
  board_clock::begin();
  status::begin();
  if (!MRL_ENVIRONMENT && !MRL_BRIDGE) sonar::begin();
  if (MRL_ENVIRONMENT) environment::begin();
  config::begin();
  motor::begin();
  if (MRL_XBEE) xbee::begin();
}

// The chip sleeps only after a quiet pass: one that began without news, in which no time had passed and no task was left
// with work.  All tasks have then been asked, and nothing has changed since, so that no deadline can be missing.
void run() {
  const bool news = hal::take_news();
  const uint16_t gap = board_clock::update();
  hal::watchdog_kick();
  failsafe::service(gap);
  if (!MRL_BRIDGE) commands::receive();  // the bus carries out a stop
  bus::service();
  commands::receive();  // a stop waits for one of the long tasks at most
  answers::service();
  commands::receive();
  motor::service();
  commands::receive();
  bus::service_background();
  if (!MRL_ENVIRONMENT) sonar::service();
  if (MRL_BRIDGE) commands::receive();
  if (MRL_BRIDGE) battery::service();
  if (MRL_BRIDGE && !MRL_VIRTUAL) servo::service();
  if (MRL_BRIDGE && !MRL_VIRTUAL) ranges::service();
  if (MRL_ENVIRONMENT) environment::service();
  if (sensors::ANY) sensors::service();
  config::service();
  status::service();
  if (MRL_XBEE) xbee::service();
  baud::service();
  if (!news) hal::sleep_until(board_clock::alarm());
}

}  // namespace board
}  // namespace mrl
