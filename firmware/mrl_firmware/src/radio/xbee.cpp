#include "../../build.h"

#if MRL_XBEE

#include "xbee.h"

#include "../serial/answers.h"
#include "../board/board_clock.h"
#include "../hal/flash.h"
#include "../serial/frame_writer.h"
#include "../hal/hal.h"
#include "hold.h"
#include "../serial/protocol.h"
#include "../board/status.h"
#include "xbee_packet.h"

namespace mrl {
namespace xbee {
namespace {

enum PacketType : uint8_t {
  AT_COMMAND = 0x08,
  TRANSMIT = 0x10,
  AT_RESPONSE = 0x88,
  TRANSMIT_STATUS = 0x8B,
  RECEIVED = 0x90
};

constexpr uint8_t ADDRESS_WORDS = 4;
// The network address is not known; the packet goes as far as the network reaches; no options.
const uint8_t ROUTE[] PROGMEM = {0xFF, 0xFE, 0, 0};
constexpr uint8_t PIECE = 16;                                // longest text of one frame to the host
constexpr uint8_t RECEIVED_ADDRESS = 1, RECEIVED_TEXT = 12;  // places in a receive packet
constexpr uint8_t NODE_NETWORK = 5, NODE_ADDRESS = 7, NODE_SIZE = 15;
constexpr uint8_t DELIVERY = 5, STATUS_SIZE = 7;
constexpr uint8_t ENVELOPE = 4;  // delimiter, length and checksum
constexpr uint32_t BROKEN_OFF = board_clock::of_ms(48);  // 46 bytes at 9600 baud: the packet is incomplete

PacketReader reader;
uint32_t last_byte;
uint8_t text_at;   // start of the received text that was not sent to the host yet; 0 is nothing
bool node_waits;   // a node's answer was not sent to the host yet
bool asked;        // the frame with that answer is queued
uint8_t sum;
int16_t undelivered;

// ---- to the radio

void put(uint8_t byte) {
  sum = static_cast<uint8_t>(sum + byte);
  hal::radio_write(byte);
}

// False if the radio is still sending the previous packet.
bool begin_packet(uint8_t size, PacketType type, uint8_t frame_id = FRAME_ID) {
  if (hal::radio_room() < size + ENVELOPE) return false;
  put(DELIMITER);
  put(0);
  put(size);
  sum = 0;
  put(type);
  put(frame_id);
  return true;
}

void end_packet() { put(static_cast<uint8_t>(0xFF - sum)); }

bool discover() {
  if (!begin_packet(4, AT_COMMAND)) return false;
  put('N');
  put('D');
  end_packet();
  return true;
}

// ---- from the radio

int16_t word_of(const uint8_t* bytes) { return static_cast<int16_t>(bytes[0] << 8 | bytes[1]); }

void take_packet() {
  const uint8_t* data = reader.data();
  if (data[0] == RECEIVED && reader.size() > RECEIVED_TEXT) {
    const uint8_t size = static_cast<uint8_t>(reader.size() - RECEIVED_TEXT);
    if (!hold::take(data + RECEIVED_ADDRESS, data + RECEIVED_TEXT, size)) text_at = RECEIVED_TEXT;
  }
  if (data[0] == TRANSMIT_STATUS && reader.size() >= STATUS_SIZE && data[DELIVERY]) {
    status::count(undelivered);
    hold::tell();
  }
  const bool is_node = data[0] == AT_RESPONSE && reader.size() >= NODE_SIZE && data[2] == 'N' && data[3] == 'D';
  if (is_node && data[4] == 0) node_waits = true;
}

void ask_host() {
  if (asked || !answers::can_ask()) return;
  asked = true;
  answers::ask(text_at ? XBEE_TEXT : DISCOVER_XBEE);
}

void receive() {
  for (int16_t byte; !text_at && !node_waits && (byte = hal::radio_read()) >= 0;) {
    last_byte = board_clock::now();
    if (reader.feed(static_cast<uint8_t>(byte))) take_packet();
  }
  if (reader.in_packet() && board_clock::passed(last_byte, BROKEN_OFF)) reader.clear();
}

uint8_t piece_size() {
  const uint8_t left = static_cast<uint8_t>(reader.size() - text_at);
  return left < PIECE ? left : PIECE;
}

}  // namespace

void begin() {
  hal::radio_begin();
  hold::begin();
}

// The next packet stays in the port's queue until this one has been sent to the host.  Out of line, because the loop is
// compiled for speed, which makes this larger.
__attribute__((noinline)) void service() {
  receive();
  hold::service();
  if (text_at || node_waits) ask_host();
}

bool send(const uint8_t* address, const uint8_t* text, uint8_t size, uint8_t frame_id) {
  if (!begin_packet(static_cast<uint8_t>(14 + size), TRANSMIT, frame_id)) return false;
  for (uint8_t i = 0; i < ADDRESS_SIZE; i++) put(address[i]);
  for (uint8_t i = 0; i < sizeof ROUTE; i++) put(flash_byte(&ROUTE[i]));
  for (uint8_t i = 0; i < size; i++) put(text[i]);
  end_packet();
  return true;
}

// The rows are out of line for the same reason.
__attribute__((noinline)) void report_text() {
  const uint8_t size = piece_size();
  report_address(reader.data() + RECEIVED_ADDRESS);
  writer::add(size);
  for (uint8_t i = 0; i < size; i = static_cast<uint8_t>(i + 2)) {
    const uint8_t second = i + 1 < size ? reader.data()[text_at + i + 1] : 0;
    writer::add(static_cast<int16_t>(reader.data()[text_at + i] << 8 | second));
  }
  text_at = static_cast<uint8_t>(text_at + size);
  if (text_at >= reader.size()) text_at = 0;
  asked = false;
}

__attribute__((noinline)) void report_node() {
  report_address(reader.data() + NODE_ADDRESS);
  writer::add(word_of(reader.data() + NODE_NETWORK));
  node_waits = asked = false;
}

__attribute__((noinline)) void report_radio() { hold::report(undelivered); }

__attribute__((noinline)) void report_address(const uint8_t* address) {
  for (uint8_t i = 0; i < ADDRESS_SIZE; i = static_cast<uint8_t>(i + 2)) writer::add(word_of(address + i));
}

}  // namespace xbee

namespace handlers {

void send_xbee(const int16_t* args, uint8_t count) {
  const uint8_t length = static_cast<uint8_t>(args[xbee::ADDRESS_WORDS]);
  const uint8_t words = static_cast<uint8_t>(count - xbee::ADDRESS_WORDS - 1);
  if (words != static_cast<uint8_t>(length + 1) / 2) return status::refuse(Reason::argument_count);
  uint8_t bytes[xbee::ADDRESS_SIZE + 2 + xbee::PIECE];  // address, length, text
  for (uint8_t* byte = bytes; count; count--, args++) {
    *byte++ = static_cast<uint8_t>(*args >> 8);
    *byte++ = static_cast<uint8_t>(*args);
  }
  if (!xbee::send(bytes, bytes + xbee::ADDRESS_SIZE + 2, length, xbee::FRAME_ID)) status::refuse(Reason::unavailable);
}

void discover_xbee(const int16_t*, uint8_t) {
  if (!xbee::discover()) status::refuse(Reason::unavailable);
}

}  // namespace handlers
}  // namespace mrl

#endif
