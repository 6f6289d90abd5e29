/* Proves every SIMD variant of every kernel equal to C on random and extreme inputs, and times
 * them.
 *
 *   test_kernels                     check all
 *   test_kernels NAME...             check the kernels whose name contains NAME
 *   test_kernels --seed S NAME       repeat a failure
 *   test_kernels --bench [NAME...]   time each variant: nanoseconds per image, and how many times C
 *   test_kernels --times N VARIANT   do the work of that benchmark N times (to count instructions,
 *                                    to profile)
 *   test_kernels --list              names of the variants that this processor can run
 *
 * Variants that the processor lacks are named and skipped. FOVEA_CPU caps what is run. */
#include "kernels/check.h"

#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static struct options {
    char **names;
    int name_count;
    uint64_t seed;
    bool seeded, bench;
    uint32_t isas;
} options;

static struct check current;

static void run_times(const struct kernel_variant *variant, long times)
{
    current = (struct check){.random = 1, .kernel = variant->kernel, .isa = variant->isa};
    for (long i = 0; i < times; i++)
        variant->bench(&current);
    check_release(&current);
}

/* Options about single variants; true when there was one. */
static bool run_single(int argc, char **argv)
{
    const bool list = argc == 2 && strcmp(argv[1], "--list") == 0;
    const bool times = argc == 4 && strcmp(argv[1], "--times") == 0;
    for (int i = 0; i < kernel_variant_count; i++) {
        const struct kernel_variant *variant = &kernel_variants[i];
        char name[96];
        snprintf(name, sizeof name, "%s__%s", variant->kernel, variant->isa);
        if ((variant->bit & options.isas) != variant->bit) continue;
        if (list) printf("%s\n", name);
        if (times && strcmp(name, argv[3]) == 0) run_times(variant, strtol(argv[2], NULL, 10));
    }
    return list || times;
}

static bool chosen(const struct kernel_variant *variant)
{
    if (options.name_count == 0) return true;
    for (int i = 0; i < options.name_count; i++)
        if (strstr(variant->kernel, options.names[i]) != NULL) return true;
    return false;
}

static bool available(const struct kernel_variant *variant)
{
    return (variant->bit & options.isas) == variant->bit;
}

/* A kernel that reads past its input meets an inaccessible page: say which before dying. */
static void on_fault(int number)
{
    char line[256];
    const int bytes = snprintf(
        line, sizeof line, "FAILED %s__%s, seed %llu: signal %d (access outside a buffer?)\n",
        current.kernel, current.isa, (unsigned long long)current.seed, number);
    if (write(STDOUT_FILENO, line, (size_t)bytes) != bytes) _exit(2);
    _exit(1);
}

static void check_variant(void **state)
{
    const struct kernel_variant *variant = *state;
    if (!available(variant)) {
        printf("SKIPPED %s__%s: not on this processor\n", variant->kernel, variant->isa);
        skip();
    }
    enum { ROUNDS = 200 };
    for (int round = 0; round < (options.seeded ? 1 : ROUNDS); round++) {
        const uint64_t seed = options.seeded ? options.seed : (uint64_t)round * 1000003u + 17;
        current = (struct check){
            .seed = seed, .random = seed, .kernel = variant->kernel, .isa = variant->isa};
        variant->check(&current);
        check_release(&current);
        if (current.failed) fail_msg("%s__%s", variant->kernel, variant->isa);
    }
}

static int64_t now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

static int ascending(const void *a, const void *b)
{
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

static int64_t time_variant(const struct kernel_variant *variant)
{
    enum { SAMPLES = 31 };
    int64_t samples[SAMPLES], spent = 0;
    int count = 0;
    current = (struct check){.random = 1, .kernel = variant->kernel, .isa = variant->isa};
    variant->bench(&current);
    while (count < SAMPLES && (count < 5 || spent < 200000000)) {
        const int64_t start = now_ns();
        variant->bench(&current);
        samples[count] = now_ns() - start;
        spent += samples[count++];
    }
    qsort(samples, (size_t)count, sizeof *samples, ascending);
    check_release(&current);
    return samples[count / 2];
}

static int bench(void)
{
    int64_t c_ns = 0;
    printf("%-28s %-10s %12s %8s  %s\n", "kernel", "isa", "ns", "times C", "size");
    for (int i = 0; i < kernel_variant_count; i++) {
        const struct kernel_variant *variant = &kernel_variants[i];
        if (!chosen(variant) || !available(variant)) continue;
        const int64_t ns = time_variant(variant);
        if (variant->bit == 0) c_ns = ns;
        printf("%-28s %-10s %12lld %8.2f  %s\n", variant->kernel, variant->isa, (long long)ns,
               (double)c_ns / (double)(ns > 0 ? ns : 1),
               current.size[0] != '\0' ? current.size : "752x480");
    }
    return 0;
}

int main(int argc, char **argv)
{
    struct fovea_error error;
    enum fv_cpu_set cap;
    if (fv_cpu_from_environment(&cap, &error) != FOVEA_OK) {
        printf("%s\n", error.text);
        return 2;
    }
    options.isas = fv_cpu_detect() & fv_cpu_allowed(cap);
    if (run_single(argc, argv)) return 0;
    int first = 1;
    while (first < argc && strncmp(argv[first], "--", 2) == 0) {
        if (strcmp(argv[first], "--bench") == 0) {
            options.bench = true;
        } else if (strcmp(argv[first], "--seed") == 0 && first + 1 < argc) {
            options.seeded = true;
            options.seed = strtoull(argv[++first], NULL, 10);
        } else {
            printf("usage: test_kernels [--bench] [--seed S] [NAME...]\n");
            return 2;
        }
        first++;
    }
    options.names = argv + first;
    options.name_count = argc - first;
    setvbuf(stdout, NULL, _IOLBF, 0);
    if (options.bench) return bench();
    signal(SIGSEGV, on_fault);
    signal(SIGBUS, on_fault);

    struct CMUnitTest *tests = calloc((size_t)kernel_variant_count, sizeof *tests);
    char(*names)[96] = calloc((size_t)kernel_variant_count, sizeof *names);
    size_t count = 0;
    for (int i = 0; i < kernel_variant_count && tests != NULL && names != NULL; i++) {
        if (!chosen(&kernel_variants[i])) continue;
        snprintf(names[count], sizeof *names, "%s__%s", kernel_variants[i].kernel,
                 kernel_variants[i].isa);
        tests[count] = (struct CMUnitTest){.name = names[count],
                                           .test_func = check_variant,
                                           .initial_state = (void *)(uintptr_t)&kernel_variants[i]};
        count++;
    }
    if (count == 0) {
        printf("no kernel of that name\n");
        return 2;
    }
    const int failed = _cmocka_run_group_tests("kernels", tests, count, NULL, NULL);
    free(tests);
    free(names);
    return failed == 0 ? 0 : 1;
}
