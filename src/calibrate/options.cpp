#include "calibrate/command.h"

#include <cstdio>

extern "C" {
#include "support/say.h"
}

namespace calibrate
{

bool options_parse(int argc, char **argv, const std::vector<Option> &options, const char *operands,
                   size_t operand_count, std::vector<std::string> &found, int *status)
{
    const char *command = argv[0];
    for (int i = 1; i < argc; i++) {
        const std::string word = argv[i];
        if (word == "--help" || word == "-h") {
            printf("usage: fovea-calibrate %s [OPTION]...%s%s\n\n", command,
                   operands[0] != '\0' ? " " : "", operands);
            for (const Option &option : options) {
                const std::string name = std::string("--") + option.name + " " + option.value;
                printf("  %-24s %s\n", name.c_str(), option.help);
            }
            *status = FV_EXIT_OK;
            return false;
        }
        if (word.compare(0, 2, "--") != 0) {
            found.push_back(word);
            continue;
        }
        const size_t equals = word.find('=');
        const std::string name = word.substr(2, equals == std::string::npos ? equals : equals - 2);
        const Option *option = nullptr;
        for (const Option &one : options)
            if (name == one.name) option = &one;
        if (option == nullptr) {
            *status = fv_say_wrong("fovea-calibrate %s: unknown option '--%s' (--help lists all)",
                                   command, name.c_str());
            return false;
        }
        if (equals == std::string::npos && i + 1 >= argc) {
            *status = fv_say_wrong("fovea-calibrate %s: --%s: found nothing after it, expected %s",
                                   command, option->name, option->value);
            return false;
        }
        *option->target = equals == std::string::npos ? argv[++i] : word.substr(equals + 1);
    }
    if (found.size() == operand_count) return true;
    *status = fv_say_wrong("fovea-calibrate %s: found %zu operands, expected %zu%s%s", command,
                           found.size(), operand_count, operand_count > 0 ? ": " : "", operands);
    return false;
}

} // namespace calibrate
