/* The process that keeps libcamera (drivers/libcamera/protocol.h), played by the test program
 * itself: started under that name, it serves frames of a made-up camera and does wrong what the
 * test asks for. Test and process share a stage: a file in a folder of its own, in which the name
 * also is; FOVEA_PLUGINS points to it. */
#ifndef FOVEA_TESTS_FAKE_LIBCAMERA_H
#define FOVEA_TESTS_FAKE_LIBCAMERA_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { FAKE_WIDTH = 96, FAKE_HEIGHT = 64, FAKE_STRIDE = 128 };

enum fake_fault {
    FAKE_NONE = 0,
    FAKE_ABORT,       /* abort() */
    FAKE_EXIT,        /* with status 3 */
    FAKE_HANG,        /* does nothing any more, whatever it is asked */
    FAKE_BUSY,        /* works for a second and a half, then answers */
    FAKE_SHORT,       /* a message of three bytes */
    FAKE_VERSION,     /* a message of another version */
    FAKE_INDEX,       /* a frame in a buffer that there is not */
    FAKE_DESCRIPTORS, /* a message of a wrong size with descriptors */
    FAKE_FEWER,       /* fewer buffers than were agreed on */
    FAKE_BROKEN       /* refuses, or says that streaming is over */
};

struct fake_stage {
    char folder[64];
    _Atomic double rate_hz; /* that it says; frames come every 5 ms */
    atomic_bool away;       /* the camera is unplugged */
    atomic_bool deaf;       /* a process that has seen it away does not see it come */
    atomic_int fault, fault_at_set_up, fault_at_learn,
        fault_when_set;         /* enum fake_fault, done once */
    atomic_bool stubborn;       /* not once, but by each process */
    atomic_int scribble;        /* 1 + value: written into the first byte of all buffers, then 0 */
    atomic_uint lives, set_ups; /* processes started; asked to stream */
    atomic_uint missed;         /* times that one said that the camera is away */
    atomic_int pid;             /* of the last */
    atomic_int exposure_us, gain; /* set last; gain in thousandths */
    atomic_bool refuses;          /* to be set */
    atomic_uint before_answer;    /* frames that it sends first */
};

/* In the test. */
struct fake_stage *fake_stage_open(void);
void fake_stage_reset(struct fake_stage *stage);
void fake_stage_hide(struct fake_stage *stage, bool hidden); /* the program cannot be found */
void fake_stage_close(struct fake_stage *stage);
void fake_libcamera_end_all(void); /* kills and reaps all children of this process */

/* In the process. */
bool fake_libcamera_is_me(const char *name); /* argv[0] */
int fake_libcamera_run(void);

/* A picture by its sequence number. */
static inline uint8_t fake_pixel(uint64_t sequence, int32_t x, int32_t y)
{
    return (uint8_t)(sequence * 31 + (uint64_t)x * 3 + (uint64_t)y * 7);
}

/* What this process holds: descriptors, mapped buffers, child processes, heap. */
struct fake_holdings {
    long descriptors, buffers, processes;
    size_t heap_bytes;
};
struct fake_holdings fake_holdings(void);

#endif
