// A library that lets the n-th call of a kind fail, from main() on, for tools/faults.py:
//   LD_PRELOAD=fail_nth.so FAIL_CALL=write FAIL_NTH=3 FAIL_ERRNO=28 FAIL_COUNT=0 FAIL_LOG=/tmp/log alidade …
// FAIL_COUNT: how many calls fail from that one on (1); 0: all (a full disk). FAIL_LOG: how often it was called,
// and whether it failed, written as the process ends. FAIL_TRACE=/tmp/trace: from where the failed call came. FAIL_KILL=1: instead of failing,
// the call kills the process. Kinds: open, write, rename, mkdir, sync, mmap, malloc.
// FAIL_FORK=/tmp/log: until the first file is opened for writing each call is the n-th, in a copy of the process that goes on from there. A
// line of the log has the call, how the copy ended (as wait says; exit code 77: it went on, to that first file) and how many lines it gave on
// standard error, which must be a file. A copy removes no files: the process itself still needs them.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <execinfo.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <unistd.h>

static atomic_long calls;
static atomic_int failed;
static int in_main, error = EIO;
static long nth, count = 1;
static char kind[16];

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static int fork_log = -1, fork_said = -1;  // of FAIL_FORK, and what is said on standard error
static int is_copy;

// In a copy of the process 1: there it is the n-th. In the process itself 0, once the copy has ended.
static int fails_in_a_copy(long call) {
  in_main = 0;
  const off_t before = lseek(fork_said, 0, SEEK_END);
  const pid_t copy = fork();
  if (copy == 0) {
    fork_log = -1;
    is_copy = 1;
    nth = call;
    in_main = 1;
    alarm(20);
    return 1;
  }
  int status = -1;
  while (waitpid(copy, &status, 0) < 0 && errno == EINTR) {
  }
  char text[4096], line[64];
  const ssize_t size = pread(fork_said, text, sizeof text, before);
  int lines = 0;
  for (ssize_t i = 0; i < size; ++i) lines += text[i] == '\n';
  const int written = snprintf(line, sizeof line, "%ld %d %d\n", call, status, lines);
  (void)!syscall(SYS_write, fork_log, line, (size_t)written);
  in_main = 1;
  return 0;
}

static void prepare_copies(const char* log) {
  fork_log = (int)syscall(SYS_openat, AT_FDCWD, log, O_WRONLY | O_CREAT | O_TRUNC, 0600);
  fork_said = (int)syscall(SYS_openat, AT_FDCWD, "/proc/self/fd/2", O_RDONLY);
}

static void opens_to_write(int does) {
  if (!does || !in_main) return;
  if (is_copy) _exit(77);
  fork_log = -1;
}

static int fails(const char* of) {
  if (!in_main || strcmp(kind, of) != 0) return 0;
  const long call = atomic_fetch_add(&calls, 1) + 1;
  if (fork_log >= 0) {
    if (!fails_in_a_copy(call)) return 0;
  } else if (nth == 0 || call < nth || (count != 0 && call >= nth + count)) {
    return 0;
  }
  if (getenv("FAIL_KILL") != NULL) kill(getpid(), SIGKILL);
  atomic_store(&failed, 1);
  const char* const trace = getenv("FAIL_TRACE");
  if (trace != NULL) {
    void* frames[40];
    in_main = 0;
    const int file = (int)syscall(SYS_openat, AT_FDCWD, trace, O_WRONLY | O_CREAT | O_TRUNC, 0600);
    backtrace_symbols_fd(frames, backtrace(frames, 40), file);
    syscall(SYS_close, file);
    in_main = 1;
  }
  errno = error;
  return 1;
}

static void report(void) {
  const char* const log = getenv("FAIL_LOG");
  in_main = 0;
  if (log == NULL) return;
  char text[64];
  const int size = snprintf(text, sizeof text, "%ld %d\n", atomic_load(&calls), atomic_load(&failed));
  const int file = (int)syscall(SYS_openat, AT_FDCWD, log, O_WRONLY | O_CREAT | O_TRUNC, 0600);
  if (file >= 0) {
    (void)!syscall(SYS_write, file, text, (size_t)size);
    syscall(SYS_close, file);
  }
}

static int (*real_main)(int, char**, char**);
static int main_with_faults(int argc, char** argv, char** environment) {
  const char* text = getenv("FAIL_CALL");
  if (text != NULL) strncpy(kind, text, sizeof kind - 1);
  if ((text = getenv("FAIL_NTH")) != NULL) nth = atol(text);
  if ((text = getenv("FAIL_ERRNO")) != NULL) error = atoi(text);
  if ((text = getenv("FAIL_COUNT")) != NULL) count = atol(text);
  if ((text = getenv("FAIL_FORK")) != NULL) prepare_copies(text);
  unsetenv("LD_PRELOAD");  // programs that this one starts are left alone
  atexit(report);
  in_main = 1;
  return real_main(argc, argv, environment);
}

int __libc_start_main(int (*main)(int, char**, char**), int argc, char** argv, void (*init)(void), void (*fini)(void),
                      void (*rtld_fini)(void), void* stack_end) {
  real_main = main;
  int (*start)(int (*)(int, char**, char**), int, char**, void (*)(void), void (*)(void), void (*)(void), void*) =
      dlsym(RTLD_NEXT, "__libc_start_main");
  return start(main_with_faults, argc, argv, init, fini, rtld_fini, stack_end);
}

// A disk can be full; a terminal and a pipe can not.
static int is_on_disk(int file) {
  struct stat status;
  return fstat(file, &status) == 0 && S_ISREG(status.st_mode);
}

#define MODE_OF(flags) \
  mode_t mode = 0; \
  if (((flags) & (O_CREAT | O_TMPFILE)) != 0) { \
    va_list arguments; \
    va_start(arguments, flags); \
    mode = va_arg(arguments, mode_t); \
    va_end(arguments); \
  }

int open(const char* path, int flags, ...) {
  MODE_OF(flags)
  opens_to_write((flags & O_CREAT) != 0);
  return fails("open") ? -1 : (int)syscall(SYS_openat, AT_FDCWD, path, flags, mode);
}
int open64(const char* path, int flags, ...) {
  MODE_OF(flags)
  opens_to_write((flags & O_CREAT) != 0);
  return fails("open") ? -1 : (int)syscall(SYS_openat, AT_FDCWD, path, flags | O_LARGEFILE, mode);
}
int openat(int folder, const char* path, int flags, ...) {
  MODE_OF(flags)
  opens_to_write((flags & O_CREAT) != 0);
  return fails("open") ? -1 : (int)syscall(SYS_openat, folder, path, flags, mode);
}
FILE* fopen(const char* path, const char* how) {
  opens_to_write(how[0] != 'r');
  return fails("open") ? NULL : REAL(fopen)(path, how);
}
FILE* fopen64(const char* path, const char* how) {
  opens_to_write(how[0] != 'r');
  return fails("open") ? NULL : REAL(fopen64)(path, how);
}

ssize_t write(int file, const void* bytes, size_t count) {
  return is_on_disk(file) && fails("write") ? -1 : syscall(SYS_write, file, bytes, count);
}
ssize_t writev(int file, const struct iovec* parts, int count) {
  return is_on_disk(file) && fails("write") ? -1 : syscall(SYS_writev, file, parts, count);
}
int rename(const char* from, const char* to) {
  return fails("rename") ? -1 : (int)syscall(SYS_rename, from, to);
}
int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) {
  return fails("rename") ? -1 : (int)syscall(SYS_renameat2, from_folder, from, to_folder, to, flags);
}
int unlink(const char* path) { return is_copy ? 0 : (int)syscall(SYS_unlink, path); }
int rmdir(const char* path) { return is_copy ? 0 : (int)syscall(SYS_rmdir, path); }
int remove(const char* path) { return is_copy ? 0 : REAL(remove)(path); }
int unlinkat(int folder, const char* path, int flags) {
  return is_copy ? 0 : (int)syscall(SYS_unlinkat, folder, path, flags);
}
int mkdir(const char* path, mode_t mode) { return fails("mkdir") ? -1 : (int)syscall(SYS_mkdir, path, mode); }
int fsync(int file) { return fails("sync") ? -1 : (int)syscall(SYS_fsync, file); }
int fdatasync(int file) { return fails("sync") ? -1 : (int)syscall(SYS_fdatasync, file); }
void* mmap(void* at, size_t size, int protection, int flags, int file, off_t offset) {
  return fails("mmap") ? MAP_FAILED : (void*)syscall(SYS_mmap, at, size, protection, flags, file, offset);
}

// glibc 2.36 ends with a signal where its own dlopen finds no memory: its calls are left alone.
void* dlopen(const char* file, int mode) {
  const int was = in_main;
  in_main = 0;
  void* const library = REAL(dlopen)(file, mode);
  in_main = was;
  return library;
}

extern void* __libc_malloc(size_t);
extern void* __libc_calloc(size_t, size_t);
extern void* __libc_realloc(void*, size_t);
extern void* __libc_memalign(size_t, size_t);
void* malloc(size_t size) { return fails("malloc") ? NULL : __libc_malloc(size); }
void* calloc(size_t count, size_t size) { return fails("malloc") ? NULL : __libc_calloc(count, size); }
void* realloc(void* old, size_t size) { return fails("malloc") ? NULL : __libc_realloc(old, size); }
void* aligned_alloc(size_t alignment, size_t size) {
  return fails("malloc") ? NULL : __libc_memalign(alignment, size);
}
int posix_memalign(void** to, size_t alignment, size_t size) {
  if (fails("malloc")) return ENOMEM;
  *to = __libc_memalign(alignment, size);
  return *to == NULL ? ENOMEM : 0;
}
