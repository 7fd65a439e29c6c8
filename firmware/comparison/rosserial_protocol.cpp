// A sketch of ours that speaks the wire protocol of rosserial: wiki.ros.org/rosserial/Overview/Protocol, ROS Hydro and
// later.  It is written without ros_lib, and is not for robots.
//
// A std_msgs/Empty on `read_encoders` makes it publish both counters, a std_msgs/Int16 each on `right` and `left`.
// A packet is FF FE, length (2 bytes), its checksum, topic (2 bytes), message, checksum of topic and message; low bytes
// come first.  A packet for topic 0 asks for the topics.  ros_lib also asks the host for the time now and then; this
// sketch does not.
#include <string.h>

#include "motor_board.h"

#ifndef ROSSERIAL_BAUD
#define ROSSERIAL_BAUD 57600  // the default of ros_lib and of rosserial_python
#endif

namespace {

constexpr uint16_t PUBLISHER = 0, SUBSCRIBER = 1, READ_ENCODERS = 100, RIGHT = 101, LEFT = 102;
constexpr uint8_t HEAD_BYTES = 7;
constexpr uint16_t BUFFER_BYTES = 150;

uint8_t in[BUFFER_BYTES], out[BUFFER_BYTES];
uint16_t received, wanted;

uint8_t checksum(const uint8_t* data, uint16_t count) {
  uint8_t sum = 0;
  for (uint16_t i = 0; i < count; ++i) {
    sum = static_cast<uint8_t>(sum + data[i]);
  }
  return static_cast<uint8_t>(255 - sum);
}

uint8_t* put_word(uint8_t* at, uint16_t value) {
  *at++ = static_cast<uint8_t>(value & 0xFF);
  *at++ = static_cast<uint8_t>(value >> 8);
  return at;
}

uint8_t* put_text(uint8_t* at, const char* text) {
  const uint16_t length = static_cast<uint16_t>(strlen(text));
  at = put_word(put_word(at, length), 0);
  memcpy(at, text, length);
  return at + length;
}

// Sends the message that ends before `end` in the buffer.
void publish(uint16_t topic, uint8_t* end) {
  const uint16_t length = static_cast<uint16_t>(end - out - HEAD_BYTES);
  out[0] = 0xFF;
  out[1] = 0xFE;
  put_word(out + 2, length);
  out[4] = checksum(out + 2, 2);
  put_word(out + 5, topic);
  *end = checksum(out + 5, static_cast<uint16_t>(length + 2));
  Serial.write(out, static_cast<size_t>(length) + HEAD_BYTES + 1);
}

void publish_count(uint16_t topic, int16_t count) {
  publish(topic, put_word(out + HEAD_BYTES, static_cast<uint16_t>(count)));
}

void publish_topic(uint16_t kind, uint16_t topic, const char* name, const char* type, const char* md5sum) {
  uint8_t* end = put_word(out + HEAD_BYTES, topic);
  end = put_text(put_text(put_text(end, name), type), md5sum);
  publish(kind, put_word(put_word(end, BUFFER_BYTES), 0));
}

void publish_topics() {
  const char* const number = "8524586e34fbd7cb1c08c5f5f1ca0e57";
  publish_topic(PUBLISHER, RIGHT, "right", "std_msgs/Int16", number);
  publish_topic(PUBLISHER, LEFT, "left", "std_msgs/Int16", number);
  publish_topic(SUBSCRIBER, READ_ENCODERS, "read_encoders", "std_msgs/Empty", "d41d8cd98f00b204e9800998ecf8427e");
}

void carry_out(uint16_t topic) {
  if (topic == 0) {
    publish_topics();
  } else if (topic == READ_ENCODERS) {
    const int16_t right = motor_board::value(motor_board::RIGHT);
    const int16_t left = motor_board::value(motor_board::LEFT);
    publish_count(RIGHT, right);
    publish_count(LEFT, left);
  }
}

// Whether the bytes so far can be the begin of a packet; the length is known after the head.
bool fits() {
  switch (received) {
    case 1:
      return in[0] == 0xFF;
    case 2:
      return in[1] == 0xFE;
    case 5:
      wanted = static_cast<uint16_t>(in[2] | (in[3] << 8)) + HEAD_BYTES + 1;
      return in[4] == checksum(in + 2, 2) && wanted <= BUFFER_BYTES;
    default:
      return true;
  }
}

void parse(uint8_t byte) {
  in[received++] = byte;
  if (!fits()) {
    received = 0;
  } else if (received > HEAD_BYTES && received == wanted) {
    received = 0;
    if (in[wanted - 1] == checksum(in + 5, static_cast<uint16_t>(wanted - HEAD_BYTES + 1))) {
      carry_out(static_cast<uint16_t>(in[5] | (in[6] << 8)));
    }
  }
}

}  // namespace

void setup() {
  Serial.begin(ROSSERIAL_BAUD);
  Wire.begin();
}

void loop() {
  while (Serial.available() > 0) {
    parse(static_cast<uint8_t>(Serial.read()));
  }
}
