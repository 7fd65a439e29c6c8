#include <fcntl.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

int mutant_in_force = -1;
unsigned char* mutants_reached = nullptr;

namespace {

constexpr size_t MOST = 1 << 16;

void map(const char* path) {
  const int file = open(path, O_RDWR);
  if (file < 0) return;
  void* const at = mmap(nullptr, MOST, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  close(file);
  if (at != MAP_FAILED) mutants_reached = static_cast<unsigned char*>(at);
}

__attribute__((constructor(101))) void begin() {
  if (const char* mutant = getenv("MRL_MUTANT")) mutant_in_force = atoi(mutant);
  if (const char* path = getenv("MRL_MUTANTS_REACHED")) map(path);
}

__attribute__((destructor)) void end() {
  if (mutants_reached) munmap(mutants_reached, MOST);
}

}  // namespace
