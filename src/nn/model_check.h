/* Checks of operator records, part of fv_model_open. */
#ifndef FOVEA_NN_MODEL_CHECK_H
#define FOVEA_NN_MODEL_CHECK_H

#include "nn/model.h"

/* Everything that running operator `index` relies on: shapes that agree, every access within its
 * tensor, constants within the file, parameters in range. Returns NULL, or what is wrong as a
 * phrase; `word` takes the record word at fault. */
const char *fv_model_check_op(const struct fv_model *model, const struct fv_model_op *op,
                              int32_t *word);

/* The tensors that are states exist, before operators are checked; and afterwards, that each is
 * read and written by one copy each and shares no bytes. */
enum fovea_status fv_model_check_state_list(const struct fv_model *model, const char *name,
                                            struct fovea_error *error);
enum fovea_status fv_model_check_state_use(const struct fv_model *model, const char *name,
                                           struct fovea_error *error);

#endif
