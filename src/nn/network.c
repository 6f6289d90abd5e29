#include "fovea/network.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "base/arena.h"
#include "nn/input.h"
#include "nn/real.h"
#include "nn/tensor.h"

struct fovea_network {
    struct fv_model model;
    struct fv_kernels kernels;
    struct fv_nn_progress progress;
    uint8_t *arena, *outputs[FV_MODEL_IO_MAX];
    uint32_t set; /* bit per input that was set since the last run */
    bool running, has_run;
};

static void carve(struct fovea_network *n, const struct fv_model *model, struct fv_arena *arena)
{
    n->model = *model;
    n->arena = fv_arena_take(arena, fv_nn_arena_bytes(model), 1);
    fv_nn_real_carve(&n->model, arena);
    for (uint32_t i = 0; i < model->header->output_count; i++)
        n->outputs[i] = fv_arena_take(arena, fv_tensor_bytes(model, model->outputs[i]), 1);
}

enum fovea_status fovea_network_size(const void *model, size_t model_bytes, size_t *bytes,
                                     struct fovea_error *error)
{
    struct fv_model opened;
    struct fovea_network unused;
    struct fv_arena arena;
    const enum fovea_status status = fv_model_open(model, model_bytes, "model", &opened, error);
    if (status != FOVEA_OK) return status;
    fv_arena_count(&arena);
    (void)fv_arena_take(&arena, 1, sizeof unused);
    carve(&unused, &opened, &arena);
    *bytes = arena.used;
    return FOVEA_OK;
}

enum fovea_status fovea_network_init(void *memory, size_t bytes, const void *model,
                                     size_t model_bytes, struct fovea_network **network,
                                     struct fovea_error *error)
{
    struct fv_model opened;
    enum fv_cpu_set cpu;
    struct fv_arena arena;
    size_t needed;
    enum fovea_status status = fovea_network_size(model, model_bytes, &needed, error);
    if (status == FOVEA_OK) status = fv_model_open(model, model_bytes, "model", &opened, error);
    if (status == FOVEA_OK) status = fv_cpu_from_environment(&cpu, error);
    if (status == FOVEA_OK) status = fv_arena_check_block(memory, bytes, needed, error);
    if (status != FOVEA_OK) return status;
    fv_arena_init(&arena, memory, bytes);
    struct fovea_network *n = fv_arena_take(&arena, 1, sizeof *n);
    if (n == NULL) return FOVEA_ERROR_MEMORY;
    fv_kernels_init(&n->kernels, cpu);
    carve(n, &opened, &arena);
    fv_nn_real_fill(&n->model, &n->kernels);
    *network = n;
    return FOVEA_OK;
}

uint32_t fovea_network_input_count(const struct fovea_network *network)
{
    return network->model.header->input_count;
}

uint32_t fovea_network_output_count(const struct fovea_network *network)
{
    return network->model.header->output_count;
}

enum fovea_status fovea_network_input(const struct fovea_network *network, uint32_t index,
                                      struct fovea_tensor *tensor)
{
    if (index >= network->model.header->input_count) return FOVEA_ERROR_ARGUMENT;
    fv_tensor_describe(&network->model, network->model.inputs[index], tensor);
    snprintf(tensor->name, sizeof tensor->name, "input%u", index);
    return FOVEA_OK;
}

enum fovea_status fovea_network_output(const struct fovea_network *network, uint32_t index,
                                       struct fovea_tensor *tensor)
{
    if (index >= network->model.header->output_count) return FOVEA_ERROR_ARGUMENT;
    fv_tensor_describe(&network->model, network->model.outputs[index], tensor);
    fv_tensor_output_name(&network->model, index, tensor->name);
    tensor->data = network->has_run ? network->outputs[index] : NULL;
    return FOVEA_OK;
}

enum fovea_status fovea_network_set(struct fovea_network *network, uint32_t index, const void *data,
                                    size_t bytes)
{
    const struct fv_model *model = &network->model;
    if (network->running || index >= model->header->input_count ||
        bytes != fv_tensor_bytes(model, model->inputs[index]))
        return FOVEA_ERROR_ARGUMENT;
    fv_tensor_write(model, model->inputs[index], network->arena, data);
    network->set |= 1u << index;
    return FOVEA_OK;
}

enum fovea_status fovea_network_set_image(struct fovea_network *network,
                                          const struct fovea_image *image)
{
    struct fv_nn_input_fit fit;
    if (network->running) return FOVEA_ERROR_ARGUMENT;
    const enum fovea_status status = fv_nn_input_fit_of(&network->model, image, &fit);
    if (status != FOVEA_OK) return status;
    fv_nn_fill(&network->model, image, &fit, NULL, network->arena, 0,
               network->model.header->preprocess.height);
    network->set = 1;
    return FOVEA_OK;
}

void fovea_network_reset(struct fovea_network *network)
{
    fv_nn_clear_states(&network->model, network->arena);
    network->set = 0;
    network->running = false;
    network->has_run = false;
}

enum fovea_status fovea_network_run(struct fovea_network *network, uint32_t units)
{
    const struct fv_model *model = &network->model;
    const uint32_t all = (1u << model->header->input_count) - 1;
    uint32_t done;
    if (!network->running && network->set != all) return FOVEA_ERROR_ARGUMENT;
    if (!network->running) network->progress = (struct fv_nn_progress){0, 0};
    network->running = true;
    if (fv_nn_run(model, &network->kernels, network->arena, &network->progress,
                  units == 0 ? UINT32_MAX : units, &done) == FOVEA_AGAIN)
        return FOVEA_AGAIN;
    for (uint32_t i = 0; i < model->header->output_count; i++)
        fv_tensor_read(model, model->outputs[i], network->arena, network->outputs[i]);
    network->running = false;
    network->has_run = true;
    network->set = 0;
    return FOVEA_OK;
}
