/* Loaded before another program (LD_PRELOAD), hides AVX-512, AVX-VNNI and AMX from it: for timing a
 * library's AVX2 code on a processor that has more. Libraries ask by the CPUID instruction; where
 * kernel and processor can make it fault (arch_prctl(ARCH_SET_CPUID, 0), Linux 4.12), it is
 * answered here without those bits. Says on stderr when it cannot. */
#define _GNU_SOURCE
#include <cpuid.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/syscall.h>
#include <ucontext.h>
#include <unistd.h>

enum { SET_CPUID = 0x1012, FORBID = 0, ALLOW = 1 };

static void answer(int signal_number, siginfo_t *info, void *context)
{
    greg_t *r = ((ucontext_t *)context)->uc_mcontext.gregs;
    const uint8_t *code = (const uint8_t *)r[REG_RIP];
    uint32_t a = (uint32_t)r[REG_RAX], b, c = (uint32_t)r[REG_RCX], d;
    const uint32_t leaf = a, part = c;
    (void)info;
    if (code[0] != 0x0f || code[1] != 0xa2) { /* a fault of its own */
        signal(signal_number, SIG_DFL);
        return;
    }
    syscall(SYS_arch_prctl, SET_CPUID, ALLOW);
    __cpuid_count(leaf, part, a, b, c, d);
    syscall(SYS_arch_prctl, SET_CPUID, FORBID);
    if (leaf == 7 && part == 0) {
        b &= ~(1u << 16 | 1u << 17 | 1u << 21 | 1u << 26 | 1u << 27 | 1u << 28 | 1u << 30 |
               1u << 31); /* F DQ IFMA PF ER CD BW VL */
        c &= ~(1u << 1 | 1u << 6 | 1u << 11 | 1u << 12 |
               1u << 14); /* VBMI VBMI2 VNNI BITALG VPOPCNTDQ */
        d &= ~(1u << 2 | 1u << 3 | 1u << 8 | 1u << 22 | 1u << 23 | 1u << 24 |
               1u << 25); /* 4VNNIW 4FMAPS VP2INTERSECT AMX-BF16 FP16 AMX */
    }
    if (leaf == 7 && part == 1) {
        a &= ~(1u << 4 | 1u << 5);  /* AVX-VNNI, AVX512-BF16 */
        d &= ~(1u << 4 | 1u << 10); /* AVX-VNNI-INT8, INT16 */
    }
    r[REG_RAX] = a;
    r[REG_RBX] = b;
    r[REG_RCX] = c;
    r[REG_RDX] = d;
    r[REG_RIP] += 2;
}

__attribute__((constructor)) static void hold(void)
{
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_sigaction = answer;
    action.sa_flags = SA_SIGINFO;
    if (sigaction(SIGSEGV, &action, NULL) != 0 || syscall(SYS_arch_prctl, SET_CPUID, FORBID) != 0)
        fputs("hold_avx2: this kernel or processor cannot hide CPUID\n", stderr);
}
