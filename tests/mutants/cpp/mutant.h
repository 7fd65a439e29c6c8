// Included by each mutated source.  Every mutated expression asks here which mutant is in force, so that all mutants of
// the firmware are compiled once.
#pragma once
#include <type_traits>

// Set when the library is loaded, before any other start-up code: the mutant in force, from MRL_MUTANT, and where to mark
// the mutants that change a value, from MRL_MUTANTS_REACHED.
extern __attribute__((visibility("hidden"))) int mutant_in_force;
extern __attribute__((visibility("hidden"))) unsigned char* mutants_reached;

namespace mutant {

inline void mark(int id) {
  if (mutants_reached) mutants_reached[id] = 1;
}

inline bool on(int id) {
  mark(id);
  return mutant_in_force == id;
}

// Marks only if the mutant would give another value here.
template <typename T, typename U>
inline T choose(int id, T original, U other) {
  const T changed = static_cast<T>(other);
  if (original != changed) mark(id);
  return mutant_in_force == id ? changed : original;
}

// ---- comparisons: two mutants each, numbered one after the other

template <typename A, typename B>
inline bool less(int id, A a, B b) {
  return choose(id + 1, choose(id, a < b, a <= b), a >= b);
}
template <typename A, typename B>
inline bool less_or_equal(int id, A a, B b) {
  return choose(id + 1, choose(id, a <= b, a < b), a > b);
}
template <typename A, typename B>
inline bool greater(int id, A a, B b) {
  return choose(id + 1, choose(id, a > b, a >= b), a <= b);
}
template <typename A, typename B>
inline bool greater_or_equal(int id, A a, B b) {
  return choose(id + 1, choose(id, a >= b, a > b), a < b);
}
template <typename A, typename B>
inline bool equal(int id, A a, B b) {
  return choose(id, a == b, a != b);
}
template <typename A, typename B>
inline bool unequal(int id, A a, B b) {
  return choose(id, a != b, a == b);
}

// ---- arithmetic

template <typename A, typename B>
inline decltype(A() + B()) add(int id, A a, B b) {
  return choose(id, a + b, a - b);
}
template <typename A, typename B>
inline decltype(A() - B()) subtract(int id, A a, B b) {
  return choose(id, a - b, a + b);
}
template <typename A, typename B>
inline decltype(A() * B()) multiply(int id, A a, B b) {
  return choose(id, a * b, b ? a / b : a);
}
template <typename A, typename B>
inline decltype(A() / B()) divide(int id, A a, B b) {
  return choose(id, a / b, a * b);
}
template <typename A, typename B>
inline decltype(A() % B()) remainder(int id, A a, B b) {
  return choose(id, a % b, a / b);
}
template <typename A, typename B>
inline decltype(A() << B()) shift_left(int id, A a, B b) {
  return choose(id, a << b, a >> b);
}
template <typename A, typename B>
inline decltype(A() >> B()) shift_right(int id, A a, B b) {
  return choose(id, a >> b, a << b);
}
template <typename A, typename B>
inline decltype(A() & B()) both(int id, A a, B b) {
  return choose(id, a & b, a | b);
}
template <typename A, typename B>
inline decltype(A() | B()) either(int id, A a, B b) {
  return choose(id, a | b, a & b);
}
template <typename A, typename B>
inline decltype(A() ^ B()) differing(int id, A a, B b) {
  return choose(id, a ^ b, a & b);
}
template <typename A>
inline decltype(-A()) negative(int id, A a) {
  return choose(id, -a, +a);
}

// ---- changes of variables

template <typename A, typename B>
inline A& add_to(int id, A& a, B b) {
  return a = static_cast<A>(add(id, a, b));
}
template <typename A, typename B>
inline A& subtract_from(int id, A& a, B b) {
  return a = static_cast<A>(subtract(id, a, b));
}
template <typename A, typename B>
inline A& multiply_by(int id, A& a, B b) {
  return a = static_cast<A>(multiply(id, a, b));
}
template <typename A, typename B>
inline A& divide_by(int id, A& a, B b) {
  return a = static_cast<A>(divide(id, a, b));
}
template <typename A, typename B>
inline A& keep(int id, A& a, B b) {
  return a = static_cast<A>(both(id, a, b));
}
template <typename A, typename B>
inline A& set(int id, A& a, B b) {
  return a = static_cast<A>(either(id, a, b));
}
template <typename A>
inline A& increment(int id, A& a) {
  return on(id) ? --a : ++a;
}
template <typename A>
inline A& decrement(int id, A& a) {
  return on(id) ? ++a : --a;
}
template <typename A>
inline A post_increment(int id, A& a) {
  return on(id) ? a-- : a++;
}
template <typename A>
inline A post_decrement(int id, A& a) {
  return on(id) ? a++ : a--;
}

// ---- values: 1 more or, as the next mutant, 1 less

inline int step(int id) { return on(id) ? 1 : on(id + 1) ? -1 : 0; }
inline int one(int id) { return on(id) ? 1 : 0; }
template <typename T>
inline T next(int id, T name) {
  return on(id) ? static_cast<T>(static_cast<int>(name) + 1) : name;
}
inline bool negated(int id, bool value) { return on(id) ? !value : value; }
// What is returned: 0 for all but 0, and 1 for 0.
template <typename T>
inline T other(int id, T value) {
  return on(id) ? static_cast<T>(static_cast<bool>(value) ? 0 : 1) : value;
}

}  // namespace mutant
