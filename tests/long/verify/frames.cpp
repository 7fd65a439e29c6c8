// All reachable states of the firmware's decoder and writer of frames.  See "Frames" in README.md for what is merged and why.
//
//   frames             everything
//   frames LONGEST     the decoder, with frames up to this length only [byte]
//   frames writer      the writer alone
//
// Prints a line of figures for each part.  The first difference ends the program with 1 and the bytes that lead to it.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <deque>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#define private public
#include "src/serial/frame_decoder.cpp"
#undef private
#include "src/serial/frame_writer.cpp"

using namespace mrl;

namespace {

std::string shown(const std::string& bytes) {
  std::string text;
  for (const char c : bytes) {
    char byte[8];
    snprintf(byte, sizeof byte, c >= ' ' && c <= '~' ? "%c" : "\\x%02x", static_cast<uint8_t>(c));
    text += byte;
  }
  return text;
}

[[noreturn]] void fail(const std::string& what, const std::string& after) {
  printf("wrong: %s, after %s\n", what.c_str(), shown(after).c_str());
  exit(1);
}

uint16_t crc_of(const std::string& bytes) {
  uint32_t crc = 0xFFFF;
  for (const char c : bytes) {
    for (int bit = 7; bit >= 0; bit--) {
      const uint32_t high = crc >> 15 ^ (static_cast<uint8_t>(c) >> bit & 1);
      crc = (crc << 1 & 0xFFFF) ^ (high ? 0x1021 : 0);
    }
  }
  return static_cast<uint16_t>(crc);
}

// ---- the reference: keeps the text of a frame and judges it at its end

struct Result {
  Verdict verdict = Verdict::none;
  Reason reason = Reason::noise;
  int length = 0;
  int code = 0;
  std::vector<int> arguments;
};

struct Row {
  int least, most, guarded, first;
  bool request;
};

#define REQUEST(code, constant, name, there, least, most, guarded, stamped, first, ...) {least, most, guarded, first, true},
#define REPLY(...) {0, 0, 0, 0, false},
const Row ROWS[] = {MRL_COMMANDS(REQUEST, REQUEST, REPLY)};
const int LIMITS_OF_ARGUMENTS[][2] = {MRL_COMMANDS(RANGES_OF, RANGES_OF, RANGES_OF)};

bool is_canonical(const std::string& token) {
  const size_t first = token[0] == '-';
  if (token.size() == first || token == "-0" || (token[first] == '0' && token.size() > first + 1)) return false;
  return token.find_first_not_of("0123456789", first) == std::string::npos;
}

bool fits_int16(const std::string& token) {
  const size_t digits = token.size() - (token[0] == '-');
  if (digits > 5) return false;
  const int value = atoi(token.c_str());
  return value >= -32768 && value <= 32767;
}

Result garbage(Reason reason, size_t length) {
  Result result;
  result.verdict = Verdict::garbage;
  result.reason = reason;
  result.length = static_cast<int>(length);
  return result;
}

// What the decoder was told.
struct Mode {
  bool checked, asked, plain_calibrate;
};

const Mode PLAIN = {false, false, false}, CHECKED = {true, true, false};
const Mode MODES[] = {PLAIN, CHECKED, {false, true, false}, {false, false, true}, {false, true, true}, {true, true, true}};

// `text` is from '@' to 'e'.
Result judge(const std::string& text, const Mode& mode) {
  std::vector<std::string> tokens(1);
  for (size_t i = 1; i + 1 < text.size(); i++) {
    if (text[i] == ',') {
      tokens.emplace_back();
    } else {
      tokens.back() += text[i];
    }
  }
  std::vector<int> values;
  for (const std::string& token : tokens) {
    if (!is_canonical(token)) return garbage(Reason::not_integer, text.size());
    if (!fits_int16(token)) return garbage(Reason::beyond_int16, text.size());
    values.push_back(atoi(token.c_str()));
  }
  if (values.size() > MAX_ARGUMENTS + 1) return garbage(Reason::argument_count, text.size());
  const int code = values[0];
  values.erase(values.begin());
  const Row* row = code >= 1 && code <= MAX_CODE && ROWS[code - 1].request ? &ROWS[code - 1] : nullptr;
  const bool turns = row && (row->guarded == 2 || code == CALIBRATE);
  const bool bare = values.empty() && (code == STOP_CODE || (code == CALIBRATE && mode.plain_calibrate && !mode.asked));
  if (!bare && (mode.checked || (row && row->guarded == 1) || (turns && mode.asked))) {
    const uint16_t right = crc_of(text.substr(0, text.rfind(',')));
    if (values.empty() || static_cast<uint16_t>(values.back()) != right) return garbage(Reason::bad_check, text.size());
    values.pop_back();
  }
  if (!row) return garbage(Reason::unknown_command, text.size());
  const int count = static_cast<int>(values.size());
  if (count < row->least || count > row->most) return garbage(Reason::argument_count, text.size());
  for (int i = 0; i < count; i++) {
    const int* limits = LIMITS_OF_ARGUMENTS[row->first + i];
    if (values[i] < limits[0] || values[i] > limits[1]) return garbage(Reason::argument_range, text.size());
  }
  Result result;
  result.verdict = Verdict::frame;
  result.length = static_cast<int>(text.size());
  result.code = code;
  result.arguments = values;
  return result;
}

struct Reference {
  std::string text;  // the frame from '@' on, or the noise
  bool in_frame = false;

  Result feed(char byte, const Mode& mode) {
    if (byte == '@') {
      const Result result = text.empty() ? Result() : garbage(in_frame ? Reason::restarted : Reason::noise, text.size());
      in_frame = true;
      text = "@";
      return result;
    }
    const bool line_end = byte == '\r' || byte == '\n';
    if (!in_frame && line_end) return text.empty() ? Result() : drop(Reason::noise);
    text += byte;
    if (!in_frame) return text.size() >= MAX_NOISE ? drop(Reason::noise) : Result();
    if (byte == 'e') {
      const Result result = judge(text, mode);
      clear();
      return result;
    }
    return text.size() >= MAX_FRAME ? drop(Reason::too_long) : Result();
  }
  Result drop(Reason reason) {
    const Result result = garbage(reason, text.size());
    clear();
    return result;
  }
  void clear() {
    text.clear();
    in_frame = false;
  }
};

// ---- the decoder

struct Node {
  FrameDecoder decoder;
  Reference reference;
};

// Number of decimal digits, and below, at or above the first digits of 32767; 32768 is above.
int class_of(uint32_t magnitude) {
  static const uint32_t firsts[] = {0, 3, 32, 327, 3276, 32767};
  int digits = 0;
  for (uint32_t rest = magnitude; rest; rest /= 10) digits++;
  if (digits == 5) return 15 + (magnitude > 32767);
  return 3 * digits + (magnitude < firsts[digits] ? 0 : magnitude == firsts[digits] ? 1 : 2);
}

// What decides about the future, except for numbers and checksum.
uint64_t key_of(const FrameDecoder& d) {
  uint64_t key = d.length_;
  if (!d.in_frame_) return key;
  key = key << 8 | d.tokens_;
  key = key << 2 | (d.digits_ < 2 ? d.digits_ : 2);
  key = key << 5 | static_cast<unsigned>(d.overflow_ ? 31 : class_of(d.magnitude_));
  key = key << 4 | static_cast<unsigned>(d.negative_ << 3 | d.foreign_ << 2 | d.leading_zero_ << 1 | d.overflow_);
  key = key << 5 | (d.refused_ ? static_cast<unsigned>(d.reason_) + 1 : 0);
  return key << 1 | 1;
}

void compare(const FrameDecoder& d, Verdict verdict, const Result& right, const std::string& bytes) {
  if (verdict != right.verdict) fail("another verdict", bytes);
  if (verdict == Verdict::none) return;
  if (d.length() != right.length) fail("another length", bytes);
  if (d.in_frame() != (bytes.back() == '@')) fail("in a frame or not", bytes);
  if (verdict == Verdict::garbage) {
    if (d.reason() != right.reason) fail("another reason", bytes);
    return;
  }
  if (d.code() != right.code || d.count() != right.arguments.size()) fail("another frame", bytes);
  for (int i = 0; i < d.count(); i++) {
    if (d.arguments()[i] != right.arguments[i]) fail("another argument", bytes);
  }
}

long feeds;

Verdict feed(Node& node, char byte, const Mode& mode) {
  const std::string bytes = node.reference.text + byte;
  node.decoder.checked = mode.checked;
  node.decoder.asked = mode.asked;
  node.decoder.plain_calibrate = mode.plain_calibrate;
  const Verdict verdict = node.decoder.feed(static_cast<uint8_t>(byte));
  compare(node.decoder, verdict, node.reference.feed(byte, mode), bytes);
  feeds++;
  return verdict;
}

// A key of every class.  All digits have one of their own, because 3276 and 8 have.
const char LETTERS[] = "@0123456789-,ex\r\n";

// Stands for all that one more byte can do: the states that follow, and what is said about them, numbers and checksum aside.
uint64_t future(const FrameDecoder& state) {
  uint64_t all = 0;
  for (const char* byte = LETTERS; *byte; byte++) {
    FrameDecoder next = state;
    const Verdict verdict = next.feed(static_cast<uint8_t>(*byte));
    unsigned said = static_cast<unsigned>(verdict);
    if (verdict == Verdict::garbage && next.reason() <= Reason::beyond_int16) said += 4 + static_cast<unsigned>(next.reason());
    if (*byte == 'e' && said < 4 && state.in_frame()) said = 3;
    all = (all ^ key_of(next)) * 0x9E3779B97F4A7C15u;
    all = (all ^ said ^ all >> 29) * 0xBF58476D1CE4E5B9u;
    feeds++;
  }
  return all;
}

// Bytes of one class do the same: each of the 256 leads to a state to which one of the letters leads.
void check_classes(const FrameDecoder& state, const std::string& bytes) {
  FrameDecoder other = state;
  other.feed('x');
  const uint64_t key = key_of(other);
  for (int byte = 0; byte < 256; byte++) {
    if (byte && strchr(LETTERS, byte)) continue;
    other = state;
    other.feed(static_cast<uint8_t>(byte));
    feeds++;
    if (key_of(other) != key) fail("a byte unlike the others of its class", bytes + static_cast<char>(byte));
  }
}

void expect(Node node, const std::string& frame, const Mode& mode) {
  const std::string before = node.reference.text;
  Verdict verdict = Verdict::none;
  for (const char byte : frame) verdict = feed(node, byte, mode);
  if (verdict != Verdict::frame) fail("the frame " + frame + " is not accepted", before + frame);
}

std::string with_check(const std::string& head) {
  return head + "," + std::to_string(static_cast<int16_t>(crc_of(head))) + "e";
}

// Whatever came before: the next whole frame counts, and a stop needs no checksum.
void check_whole_frames(const Node& node) {
  static const std::string stop = "@13e", checked_stop = with_check("@13"), move = with_check("@9,100,-100");
  for (const Mode& mode : MODES) expect(node, stop, mode);
  expect(node, checked_stop, CHECKED);
  expect(node, move, CHECKED);
}

void search_decoder(size_t longest) {
  std::unordered_map<uint64_t, uint64_t> futures;
  std::deque<Node> open;
  long merged = 0, edges = 0;
  size_t deepest = 0;
  const auto reach = [&](const Node& node) {
    const auto found = futures.find(key_of(node.decoder));
    if (found != futures.end()) {
      merged++;
      if (found->second != future(node.decoder)) fail("a merged state has another future", node.reference.text);
      return;
    }
    futures[key_of(node.decoder)] = future(node.decoder);
    deepest = std::max(deepest, node.reference.text.size());
    check_classes(node.decoder, node.reference.text);
    check_whole_frames(node);
    open.push_back(node);
  };
  reach(Node());
  for (; !open.empty(); open.pop_front()) {
    if (open.front().reference.text.size() >= longest) continue;
    for (const char* byte = LETTERS; *byte; byte++) {
      for (const Mode& mode : {CHECKED, PLAIN}) {
        if (mode.checked && *byte != 'e') continue;
        Node next = open.front();
        feed(next, *byte, mode);
        edges++;
        reach(next);
      }
    }
  }
  printf("decoder: %zu states, %ld edges, %ld merged, longest %zu, %ld bytes\n", futures.size(), edges, merged, deepest, feeds);
}

// ---- numbers and checksum: frames of every code, every count, and numbers at each limit

std::string frame_of(int code, const std::vector<int>& arguments, int check) {
  std::string text = "@" + std::to_string(code);
  for (const int argument : arguments) text += "," + std::to_string(argument);
  if (check) text += "," + std::to_string(static_cast<int16_t>(crc_of(text) + check - 1));
  return text + "e";
}

long judged, accepted;

void try_frame(int code, const std::vector<int>& arguments) {
  for (int check = 0; check < 3; check++) {  // none, right, wrong
    const std::string text = frame_of(code, arguments, check);
    if (text.size() > MAX_FRAME) continue;
    for (const Mode& mode : MODES) {
      Node node;
      Verdict verdict = Verdict::none;
      for (const char byte : text) verdict = feed(node, byte, mode);
      judged++;
      accepted += verdict == Verdict::frame;
    }
  }
}

void judge_frames() {
  for (int code = -1; code <= MAX_CODE + 1; code++) {
    const Row* row = code >= 1 && code <= MAX_CODE && ROWS[code - 1].request ? &ROWS[code - 1] : nullptr;
    for (int count = 0; count <= MAX_ARGUMENTS + 1; count++) {
      std::vector<int> arguments;
      for (int i = 0; i < count; i++) arguments.push_back(row && i < row->most ? LIMITS_OF_ARGUMENTS[row->first + i][0] : 0);
      try_frame(code, arguments);
      for (int i = 0; row && i < count && i < row->most; i++) {
        const int* limits = LIMITS_OF_ARGUMENTS[row->first + i];
        const int low = arguments[i];
        for (const int value : {limits[0] - 1, limits[1], limits[1] + 1}) {
          arguments[i] = value;
          try_frame(code, arguments);
        }
        arguments[i] = low;
      }
    }
  }
  printf("judge: %ld frames, %ld accepted\n", judged, accepted);
}

}  // namespace

// ---- the writer

namespace {

struct Line {
  uint8_t used = 0;  // bytes in the transmitter's queue
  bool received = false;
  std::string text;  // of the frame or line that is being written
} line;

}  // namespace

namespace hal {
uint8_t serial_room() { return static_cast<uint8_t>(SERIAL_OUT_SIZE - line.used); }
bool serial_received() { return line.received; }
void serial_write(uint8_t byte) {
  if (line.used >= SERIAL_OUT_SIZE) fail("a byte without room", line.text);
  line.used++;
  line.text += static_cast<char>(byte);
}
}  // namespace hal

namespace mrl {
namespace writer {
namespace {

// All of the writer's variables, the line, and what the callers asked for.
struct State {
  int16_t values_[MAX_ARGUMENTS];
  uint16_t crc_, sequence_;
  uint8_t count_, sent_;
  Step step_;
  bool check_on_, frame_checked_, comma_out_;
  Line line_;
  int code;
  bool with_check, early, ended;
  std::vector<int16_t> added;
} asked;

State save() {
  State state = asked;
  memcpy(state.values_, values, sizeof values);
  state.crc_ = crc, state.sequence_ = next_sequence, state.count_ = count, state.sent_ = sent, state.step_ = step;
  state.check_on_ = check_on, state.frame_checked_ = frame_checked, state.comma_out_ = comma_out, state.line_ = line;
  return state;
}

void restore(const State& state) {
  asked = state;
  memcpy(values, state.values_, sizeof values);
  crc = state.crc_, next_sequence = state.sequence_, count = state.count_, sent = state.sent_, step = state.step_;
  check_on = state.check_on_, frame_checked = state.frame_checked_, comma_out = state.comma_out_, line = state.line_;
}

// Everything but numbers, checksum and sequence number.
uint64_t key() {
  uint64_t all = line.used;
  all = all << 8 | count;
  all = all << 8 | sent;
  all = all << 8 | asked.added.size();
  all = all << 2 | static_cast<unsigned>(step);
  return all << 6 | static_cast<unsigned>(check_on << 5 | frame_checked << 4 | comma_out << 3 | asked.with_check << 2 |
                                          asked.early << 1 | asked.ended);
}

// The frame that was asked for, as far as it is known.
std::string wanted() {
  std::string text = "@" + std::to_string(asked.code);
  for (const int16_t value : asked.added) text += "," + std::to_string(value);
  if (asked.early && asked.added.empty()) text += ",";
  if (!asked.ended) return text;
  if (asked.with_check) text += "," + std::to_string(static_cast<int16_t>(crc_of(text)));
  return text + "e\r\n";
}

// The line holds the beginning of the frame, and all of it once the writer rests again.
void check_line() {
  const std::string whole = wanted();
  if (whole.compare(0, line.text.size(), line.text)) fail("not the frame " + whole, line.text);
  if (asked.ended && step == Step::idle && line.text != whole) fail("the frame is not finished: " + whole, line.text);
}

const int16_t OF_EACH_LENGTH[] = {7, -7, -42, -300, -4321, -32768};

// What is still to be written gets numbers of another length.
void renumber(int16_t value) {
  for (uint8_t i = sent; i < count; i++) values[i] = asked.added[i] = value;
}

void note(int16_t value) {
  if (asked.added.size() < MAX_ARGUMENTS) asked.added.push_back(value);
}

long edges;
std::unordered_set<uint64_t> known;
std::deque<State> open_states;

void check_it_ends() {
  const State state = save();
  for (int patience = 2 * MAX_ARGUMENTS; step != Step::idle; patience--) {
    if (!patience) fail("the frame never ends", line.text);
    line.used = 0;
    service();
  }
  check_line();
  restore(state);
}

void reach() {
  edges++;
  if (!known.insert(key()).second) return;
  open_states.push_back(save());
  if (step == Step::closed) check_it_ends();
}

template <typename Act>
void edge(const State& from, Act act) {
  restore(from);
  act();
  reach();
}

void start(int code, bool early) {
  line.text.clear();
  asked.code = code, asked.with_check = check_on, asked.early = early, asked.ended = false;
  asked.added.clear();
  early ? begin_early(static_cast<uint8_t>(code)) : begin(static_cast<uint8_t>(code));
  check_line();
}

void say(const char* text) {
  const std::string before = line.text;
  line.text.clear();
  const bool fits = hal::serial_room() >= strlen(text) + 3;
  text_line(text, "!");
  const std::string right = step == Step::idle && fits ? std::string(text) + "!\r\n" : "";
  if (line.text != right) fail("a text in a frame, or half a text", before + line.text);
  line.text = before;
}

void serve(bool received) {
  line.received = received;
  const size_t before = line.text.size();
  service();
  line.received = false;
  if (received && line.text.size() > before + END_BYTES) fail("more than one number while a byte of the host waits", line.text);
  check_line();
}

void leave(const State& from) {
  if (from.line_.used) {
    edge(from, [] { line.used--; });
    edge(from, [] { line.used = 0; });
  }
  edge(from, [] { set_checked(!check_on); });
  for (const char* text : {"hi", "a text that has more bytes than the transmitter has room for, always"}) {
    edge(from, [text] { say(text); });
  }
  if (from.step_ == Step::idle) {
    restore(from);
    if (!idle()) return;
    for (const int code : {6, 42}) {
      for (const bool early : {false, true}) {
        edge(from, [=] { start(code, early); });
      }
    }
    return;
  }
  for (const int16_t value : OF_EACH_LENGTH) {
    for (const bool received : {false, true}) {
      edge(from, [=] { renumber(value), serve(received); });
    }
  }
  if (from.step_ == Step::closed) return;
  edge(from, [] { abandon(), asked.ended = false; });
  edge(from, [] { add(1234), note(1234); });
  edge(from, [] {
    if (frame_checked) note(static_cast<int16_t>(next_sequence)), note(99);
    stamp(99);
  });
  if (from.early && from.added.empty()) return;  // a frame that begins early has numbers
  for (const int16_t value : OF_EACH_LENGTH) {
    edge(from, [value] {
      renumber(value);
      asked.ended = true;
      end();
      check_line();
    });
  }
}

}  // namespace

void search() {
  reach();
  for (; !open_states.empty(); open_states.pop_front()) leave(open_states.front());
  printf("writer: %zu states, %ld edges\n", known.size(), edges);
}

}  // namespace writer
}  // namespace mrl

int main(int count, char** arguments) {
  if (crc_of("123456789") != 0x29B1) fail("the checksum of the reference", "");
  const std::string what = count > 1 ? arguments[1] : "";
  if (what != "writer") {
    search_decoder(what.empty() ? MAX_FRAME : static_cast<size_t>(atoi(what.c_str())));
    judge_frames();
  }
  if (what.empty() || what == "writer") writer::search();
}
