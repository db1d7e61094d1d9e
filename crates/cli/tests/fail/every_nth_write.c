/* Loaded before the C library: every FAIL_EVERY-th change of a file below FAIL_BELOW fails as on a full disk. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

static atomic_long seen;

static int fails(const char *path) {
    const char *below = getenv("FAIL_BELOW"), *every = getenv("FAIL_EVERY");
    if (!below || !every || strncmp(path, below, strlen(below))) return 0;
    long nth = atol(every), now = atomic_fetch_add(&seen, 1) + 1;
    const char *count = getenv("FAIL_COUNT");
    if (count) {
        FILE *file = fopen(count, "w");
        if (file) { fprintf(file, "%ld\n", now); fclose(file); }
    }
    if (nth <= 0 || now % nth) return 0;
    errno = ENOSPC;
    return 1;
}

static int fails_fd(int fd) {
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    return fails(path);
}

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

ssize_t write(int fd, const void *bytes, size_t n) { return fails_fd(fd) ? -1 : NEXT(write)(fd, bytes, n); }
ssize_t writev(int fd, const struct iovec *v, int n) { return fails_fd(fd) ? -1 : NEXT(writev)(fd, v, n); }
ssize_t copy_file_range(int in, off_t *a, int out, off_t *b, size_t n, unsigned flags) {
    return fails_fd(out) ? -1 : NEXT(copy_file_range)(in, a, out, b, n, flags);
}
int fsync(int fd) { return fails_fd(fd) ? -1 : NEXT(fsync)(fd); }
int ftruncate(int fd, off_t n) { return fails_fd(fd) ? -1 : NEXT(ftruncate)(fd, n); }
int ftruncate64(int fd, off_t n) { return fails_fd(fd) ? -1 : NEXT(ftruncate64)(fd, n); }
int rename(const char *from, const char *to) { return fails(to) ? -1 : NEXT(rename)(from, to); }
int mkdir(const char *path, mode_t mode) { return fails(path) ? -1 : NEXT(mkdir)(path, mode); }
