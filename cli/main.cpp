#include <cstdlib>  // says whether this is glibc

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include "cli/app/app.h"
#include "cli/commands/commands.h"

namespace {

/// Images and matrices come and go by the thousand. By default glibc gives the larger ones back to the system, which
/// then clears each of their pages anew: up to a third of a command's time. The Makefile says the same to tests.
void keep_freed_memory() {
#ifdef __GLIBC__
  constexpr int MiB = 1 << 20;
  mallopt(M_MMAP_THRESHOLD, 32 * MiB);
  mallopt(M_TRIM_THRESHOLD, 512 * MiB);
  mallopt(M_TOP_PAD, 4 * MiB);
#endif
}

}  // namespace

int main(int argc, char** argv) {
  keep_freed_memory();
  return alidade::cli::run_cli(argc, argv, alidade::cli::add_commands);
}
