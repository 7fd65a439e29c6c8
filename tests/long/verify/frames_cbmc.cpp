// For cbmc: one byte, and a stop, in any state that the invariant allows, with any numbers and any checksum.
#define private public
#include "frame_decoder.cpp"
#undef private

using namespace mrl;

uint8_t nondet_byte();
FrameDecoder nondet_decoder();

// Of all states between two bytes.
bool is_possible(const FrameDecoder& d) {
  if (!d.in_frame_) return d.length_ < MAX_NOISE;
  return d.length_ >= 1 && d.length_ < MAX_FRAME && d.tokens_ < d.length_ && d.digits_ < d.length_;
}

FrameDecoder start;  // all zeros, as the firmware's: cbmc leaves the members' initializers out

int main() {
  __CPROVER_assert(is_possible(start), "the first state is possible");

  FrameDecoder any = nondet_decoder();
  __CPROVER_assume(is_possible(any));
  FrameDecoder stopped = any;

  any.feed(nondet_byte());
  __CPROVER_assert(is_possible(any), "a byte leads to a possible state");

  stopped.feed('@');
  stopped.feed('1');
  stopped.feed('3');
  const Verdict verdict = stopped.feed('e');
  __CPROVER_assert(verdict == Verdict::frame && stopped.code() == STOP_CODE && !stopped.count(), "a stop is accepted");
  return 0;
}
