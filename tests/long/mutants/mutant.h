// Included by each changed source.  Each changed expression asks here which mutant is in force, so that all of them are
// compiled once.  MRL_MUTANT is its number; MRL_MUTANTS_REACHED a file where those are marked that change a value.  Both are
// read when the library is loaded, before any other start-up code.
#pragma once

extern __attribute__((visibility("hidden"))) int mutant_in_force;
extern __attribute__((visibility("hidden"))) unsigned char* mutants_reached;

namespace mutant {

inline bool on(int id) {
  if (mutants_reached) mutants_reached[id] = 1;
  return mutant_in_force == id;
}

// Marks only if the mutant would give another value here.
template <typename T, typename U>
inline T choose(int id, T original, U other) {
  const T changed = static_cast<T>(other);
  return original != changed && on(id) ? changed : original;
}

// Another operator: `x / 0` is x.
template <typename T> inline T divisor(T value) { return value ? value : T(1); }
#define MUTANT(name, usual, other)                                                        \
  template <typename A, typename B> inline decltype(A() usual B()) name(int id, A a, B b) { \
    return choose(id, a usual b, other);                                                  \
  }                                                                                       \
  template <typename A, typename B> inline A& name##_assign(int id, A& a, B b) {          \
    return a = static_cast<A>(name(id, a, b));                                            \
  }
MUTANT(add, +, a - b)
MUTANT(subtract, -, a + b)
MUTANT(multiply, *, a / divisor(b))
MUTANT(divide, /, a* b)
MUTANT(remainder, %, a / b)
MUTANT(left, <<, a >> b)
MUTANT(right, >>, a << b)
MUTANT(both, &, a | b)
MUTANT(either, |, a & b)
MUTANT(differing, ^, a & b)
#undef MUTANT
#define MUTANT(name, usual, first, second)                                 \
  template <typename A, typename B> inline bool name(int id, A a, B b) {   \
    return choose(id + 1, choose(id, a usual b, a first b), a second b);   \
  }
MUTANT(less, <, <=, >=)
MUTANT(less_or_equal, <=, <, >)
MUTANT(greater, >, >=, <=)
MUTANT(greater_or_equal, >=, >, <)
#undef MUTANT
template <typename A, typename B> inline bool equal(int id, A a, B b) { return choose(id, a == b, a != b); }
template <typename A, typename B> inline bool unequal(int id, A a, B b) { return choose(id, a != b, a == b); }
template <typename A> inline decltype(-A()) negative(int id, A a) { return choose(id, -a, +a); }
template <typename A> inline A& increment(int id, A& a) { return on(id) ? --a : ++a; }
template <typename A> inline A& decrement(int id, A& a) { return on(id) ? ++a : --a; }
template <typename A> inline A post_increment(int id, A& a) { return on(id) ? a-- : a++; }
template <typename A> inline A post_decrement(int id, A& a) { return on(id) ? a++ : a--; }

// Another value: 1 more or, as the next mutant, 1 less; the next enumerator; 0 for all but 0, and 1 for 0.
inline int step(int id) { return on(id) ? 1 : on(id + 1) ? -1 : 0; }

template <typename T> inline T next(int id, T name) { return on(id) ? static_cast<T>(static_cast<int>(name) + 1) : name; }
inline bool negated(int id, bool value) { return on(id) != value; }
template <typename T> inline T other(int id, T value) {
  return on(id) ? static_cast<T>(static_cast<bool>(value) ? 0 : 1) : value;
}

}  // namespace mutant

#ifdef MUTANT_BEGIN
#include <fcntl.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

int mutant_in_force = -1;
unsigned char* mutants_reached = nullptr;

__attribute__((constructor(101))) static void begin() {
  if (const char* mutant = getenv("MRL_MUTANT")) mutant_in_force = atoi(mutant);
  if (const char* path = getenv("MRL_MUTANTS_REACHED")) {
    const int file = open(path, O_RDWR);
    void* const at = mmap(nullptr, MUTANT_BEGIN, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    if (at != MAP_FAILED) mutants_reached = static_cast<unsigned char*>(at);
  }
}
__attribute__((destructor)) static void end() {
  if (mutants_reached) munmap(mutants_reached, MUTANT_BEGIN);
}
#endif
