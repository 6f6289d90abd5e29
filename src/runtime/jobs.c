#include "runtime/jobs.h"

/* To add a job: its member of enum fovea_job, a row here, and its file. */
const struct fv_job fv_jobs[FOVEA_JOB_COUNT] = {
    /* A window of five iterations within six frames, when keyframes are not close together, since
     * new landmarks go first; keyframes of a car follow each other by two frames. */
    [FOVEA_JOB_MAP] = {"map", "odometry.enabled", 24, 56, fv_job_map_waiting, fv_job_map_advance},
    /* A millisecond: 300 million multiply-accumulates within 20 frames. Fixed: the shipped detector
     * within two frames, ssd_mobilenet_v1 at 300 x 300 within 7. */
    [FOVEA_JOB_DETECT] = {"detect", "detect.model", 4, 56, fv_job_detect_waiting,
                          fv_job_detect_advance},
    /* The largest map corrected within 20 s. */
    [FOVEA_JOB_CLOSURE] = {"closure", "map.closures", 4, 24, fv_job_closure_waiting,
                           fv_job_closure_advance},
    /* A preview of 376x240 in 6 frames. */
    [FOVEA_JOB_PREVIEW] = {"preview", "preview.period_frames", 4, 8, fv_job_preview_waiting,
                           fv_job_preview_advance},
};

void fv_output_add(struct fovea *rt, enum fv_message_kind kind, uint32_t bytes,
                   struct fovea_outputs *outputs)
{
    if (bytes == 0 || outputs->message_count >= FOVEA_MESSAGES_MAX) return;
    outputs->messages[outputs->message_count++] = (struct fovea_message){
        .channel = rt->outbox.channel[kind],
        .data = rt->outbox.buffer[kind],
        .bytes = bytes,
        .volatile_values = kind == FV_MESSAGE_STATISTICS,
    };
}

uint32_t fv_jobs_waiting(const struct fovea *rt)
{
    uint32_t waiting = 0;
    for (int job = 0; job < FOVEA_JOB_COUNT; job++)
        waiting |= fv_jobs[job].waiting(rt) ? 1u << job : 0;
    return waiting;
}

const char *fovea_job_name(enum fovea_job job)
{
    return (unsigned)job < FOVEA_JOB_COUNT ? fv_jobs[job].name : "unknown";
}

const char *fovea_job_key(enum fovea_job job)
{
    return (unsigned)job < FOVEA_JOB_COUNT ? fv_jobs[job].key : "";
}

const char *fovea_stage_name(enum fovea_stage stage)
{
    static const char *const names[FOVEA_STAGE_JOBS] = {"pyramid", "features", "odometry",
                                                        "encode"};
    if ((unsigned)stage >= FOVEA_STAGE_COUNT) return "unknown";
    return stage < FOVEA_STAGE_JOBS ? names[stage] : fv_jobs[stage - FOVEA_STAGE_JOBS].name;
}
