// A stream: which frame the board repeats, and when the next one is due.  The IMU has a stream of its own.
#pragma once
#include <stdint.h>

namespace mrl {

class Stream {
 public:
  // Starts it with the frames of `code`, or ends it if its frames are those of `code`.  A period of 0 ms is as fast as
  // the serial link allows.
  void start(uint8_t code, int16_t period_ms);
  void stop(uint8_t code);
  // Frames that coincide with the other stream's, if both have a period.
  void align(const Stream& other);

  // Code of the frames, 0 while no stream runs.
  uint8_t code() const { return code_; }
  bool has_period() const { return period_; }
  // True when the next frame's values should be fetched.
  bool due() const;
  // True if it has been due for half a period.
  bool late() const;
  // True if it will be due within this time [tick]; never without a period.
  bool due_within(uint8_t ticks) const;
  // Plans the next frame after one was sent, or its values were not available.
  void sent();
  void failed();

 private:
  void plan(uint32_t next);

  uint32_t period_ = 0, next_ = 0;  // in eighths of a tick
  uint32_t due_ = 0;                // the first tick that is not before `next_`
  uint8_t code_ = 0;
};

namespace streams {

extern Stream main, imu;
// The row of the reply to 17.
void report();

}  // namespace streams
}  // namespace mrl
