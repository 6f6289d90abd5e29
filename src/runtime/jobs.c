#include "runtime/jobs.h"

const struct fv_job *const fv_jobs[FOVEA_JOB_COUNT] = {
#define ADDRESS(NAME, name) &fv_job_##name,
    FOVEA_JOBS(ADDRESS)
#undef ADDRESS
};

static const char *const names[FOVEA_JOB_COUNT] = {
#define TEXT(NAME, name) #name,
    FOVEA_JOBS(TEXT)
#undef TEXT
};

void fv_jobs_carve(struct fovea *rt, struct fv_carving *carving)
{
    for (int job = 0; job < FOVEA_JOB_COUNT; job++) {
        if (fv_jobs[job]->carve == NULL) continue;
        fv_jobs[job]->carve(rt, carving);
        fv_carving_book(carving, names[job]);
    }
}

void fv_jobs_frame(struct fovea *rt, const struct fovea_frame *frame)
{
    for (int job = 0; job < FOVEA_JOB_COUNT; job++)
        if (fv_jobs[job]->frame != NULL) fv_jobs[job]->frame(rt, frame);
}

void fv_jobs_reset(struct fovea *rt)
{
    for (int job = 0; job < FOVEA_JOB_COUNT; job++)
        if (fv_jobs[job]->reset != NULL) fv_jobs[job]->reset(rt);
}

void fv_output_add_piece(struct fovea *rt, enum fv_message_kind kind, size_t at, uint32_t bytes,
                         struct fovea_outputs *outputs)
{
    if (bytes == 0 || outputs->message_count >= FOVEA_MESSAGES_MAX) return;
    outputs->messages[outputs->message_count++] = (struct fovea_message){
        .channel = rt->outbox.channel[kind],
        .data = rt->outbox.buffer[kind] + at,
        .bytes = bytes,
        .volatile_values = kind == FV_MESSAGE_STATISTICS,
    };
}

void fv_output_add(struct fovea *rt, enum fv_message_kind kind, uint32_t bytes,
                   struct fovea_outputs *outputs)
{
    fv_output_add_piece(rt, kind, 0, bytes, outputs);
}

uint32_t fv_jobs_waiting(const struct fovea *rt)
{
    uint32_t waiting = 0;
    for (int job = 0; job < FOVEA_JOB_COUNT; job++)
        waiting |= fv_jobs[job]->waiting(rt) ? 1u << job : 0;
    return waiting;
}

const char *fovea_job_name(enum fovea_job job)
{
    return (unsigned)job < FOVEA_JOB_COUNT ? names[job] : "unknown";
}

const char *fovea_job_key(enum fovea_job job)
{
    return (unsigned)job < FOVEA_JOB_COUNT ? fv_jobs[job]->key : "";
}

const char *fovea_stage_name(enum fovea_stage stage)
{
    static const char *const stages[FOVEA_STAGE_JOBS] = {"pyramid", "features", "stereo",
                                                         "odometry", "encode"};
    if ((unsigned)stage >= FOVEA_STAGE_COUNT) return "unknown";
    return stage < FOVEA_STAGE_JOBS ? stages[stage] : names[stage - FOVEA_STAGE_JOBS];
}
