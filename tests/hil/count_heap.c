/* Preloaded into the process that keeps libcamera: counts its heap calls in the file that
 * HIL_HEAP_COUNT names, an unsigned long, which `hil-tool read ... heap_count=FILE` reads. */
#include <fcntl.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "common/heap_calls.h"

static atomic_ulong before_open;
static atomic_ulong *calls = &before_open;

__attribute__((constructor)) static void open_count(void)
{
    const char *path = getenv("HIL_HEAP_COUNT");
    const int fd = path == NULL ? -1 : open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    if (fd < 0 || ftruncate(fd, sizeof *calls) != 0) return;
    void *mapped = mmap(NULL, sizeof *calls, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (mapped != MAP_FAILED) calls = mapped;
    close(fd);
}

static void on_heap_call(void)
{
    atomic_fetch_add_explicit(calls, 1, memory_order_relaxed);
}

static void on_heap_free(void)
{
}
