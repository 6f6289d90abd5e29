/* A plug-in for qemu's user mode that counts executed instructions: QEMU_PLUGIN=count.so
 * tools/emulate.sh PROGRAM.
 *
 * Debian ships qemu's plug-in interface without its header, so the few calls that are needed are
 * declared here (interface version 1, qemu 4.2 and later; docs/devel/tcg-plugins.rst of qemu).
 * Counts each translation block by its length, on every thread together, and prints the sum at exit
 * on stderr. With FOVEA_COUNT_FILE=FILE, eight bytes or more, the sum stands in its first eight
 * while the program runs, which may map the same file and read it (tests/bounds/counter.h): exact
 * but for the length of the block that reads. */
#include <fcntl.h>
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

typedef uint64_t qemu_plugin_id_t;
struct qemu_plugin_tb;
struct qemu_info_t;
enum { INLINE_ADD_U64 = 0 };

extern void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t id,
                                                  void (*call)(qemu_plugin_id_t id,
                                                               struct qemu_plugin_tb *block));
extern size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *block);
extern void qemu_plugin_register_vcpu_tb_exec_inline(struct qemu_plugin_tb *block, int operation,
                                                     void *counter, uint64_t value);
extern void qemu_plugin_register_atexit_cb(qemu_plugin_id_t id,
                                           void (*call)(qemu_plugin_id_t id, void *context),
                                           void *context);

__attribute__((visibility("default"))) int qemu_plugin_version = 1;
int qemu_plugin_install(qemu_plugin_id_t id, const struct qemu_info_t *info, int argc, char **argv);

/* qemu adds without a lock: exact for one busy thread at a time */
static uint64_t own_count, *instructions = &own_count;

static void translated(qemu_plugin_id_t id, struct qemu_plugin_tb *block)
{
    (void)id;
    qemu_plugin_register_vcpu_tb_exec_inline(block, INLINE_ADD_U64, instructions,
                                             qemu_plugin_tb_n_insns(block));
}

static void ended(qemu_plugin_id_t id, void *context)
{
    (void)id, (void)context;
    fprintf(stderr, "instructions %" PRIu64 "\n", *instructions);
}

/* Whether the sum is kept where it should be. */
static bool share(const char *path)
{
    const int file = open(path, O_RDWR | O_CLOEXEC);
    if (file < 0) return false;
    void *shared = mmap(NULL, sizeof *instructions, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    if (shared != MAP_FAILED) instructions = shared;
    return shared != MAP_FAILED;
}

int qemu_plugin_install(qemu_plugin_id_t id, const struct qemu_info_t *info, int argc, char **argv)
{
    (void)info, (void)argc, (void)argv;
    const char *path = getenv("FOVEA_COUNT_FILE");
    if (path != NULL && !share(path)) {
        perror(path);
        return 1;
    }
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    qemu_plugin_register_atexit_cb(id, ended, NULL);
    return 0;
}
