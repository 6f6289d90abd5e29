#include "fault.h"

#include "support/uri_options.h"

static const char *const kind_names[] = {
#define FV_FAULT(name, needs_last) #name,
#define FV_FAULT_OTHER(name) #name,
#include "faults.def"
    NULL};

#define AT(member) offsetof(struct fv_fault_options, member)
static const struct fv_uri_option option_table[] = {
    {"kind", FV_URI_SET, AT(kinds), 0, 0, "one or more, with commas between, of:"
#define FV_FAULT(name, needs_last) " " #name
#define FV_FAULT_OTHER(name) " " #name
#include "faults.def"
     ,
     kind_names},
#define FV_FAULT_OPTION(name, kind, type, member, value, low, high, unit)                          \
    {#name, FV_URI_##kind, AT(member), low, high, unit, NULL},
#include "options.def"
#undef FV_FAULT_OPTION
};
static const struct fv_uri_table options_table = {.scheme = "fault",
                                                  .options = option_table,
                                                  .count =
                                                      sizeof option_table / sizeof option_table[0]};

enum fovea_status fv_fault_options_parse(const char *text, struct fv_fault_options *options,
                                         struct fovea_error *error)
{
    struct fv_fault_options o = {
        .kinds = 0,
#define FV_FAULT_OPTION(name, kind, type, member, value, low, high, unit) .member = value,
#include "options.def"
#undef FV_FAULT_OPTION
    };
    uint64_t given;
    const enum fovea_status status = fv_uri_options_parse(&options_table, text, &o, &given, error);
    if (status != FOVEA_OK) return status;
    if (o.kinds == 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "fault: kind: found none behind the last '?', expected %s",
                               option_table[0].unit);
    if (o.longest < o.shortest)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "fault: longest: found %d frames, expected at least those of shortest, %d",
            (int)o.longest, (int)o.shortest);
    *options = o;
    return FOVEA_OK;
}
