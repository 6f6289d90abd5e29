#include "calibrate/command.h"
#include "calibrate/pictures.h"

#include <cstdio>
#include <cstring>
#include <ctime>

#include "support/man.h"
#include "support/text.h"
extern "C" {
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow" /* it has a struct and a function of one name */
#include "support/files.h"
#pragma GCC diagnostic pop
#include "support/say.h"
}

namespace calibrate
{

namespace
{

void help_print(const char *command, const std::vector<Option> &options, const char *operands)
{
    printf("usage: fovea-calibrate %s [OPTION]...%s%s\n\n", command, operands[0] != '\0' ? " " : "",
           operands);
    for (const Option &option : options) {
        const std::string name = std::string("--") + option.name + " " + option.value;
        printf("  %-24s %s\n", name.c_str(), option.help);
    }
    printf("  %-24s %s\n  %-24s %s\n", "--help", "this text", "--man",
           "the manual page, for 'man -l'");
}

void man_print(const char *name, const std::vector<Option> &options, const char *operands)
{
    const std::string rest =
        std::string("[OPTION]...") + (operands[0] != '\0' ? " " : "") + operands;
    for (const Command &command : commands) {
        if (std::strcmp(command.name, name) != 0) continue;
        fv_man_begin("fovea-calibrate", name, command.help);
        fv_man_synopsis("fovea-calibrate", name, rest.c_str());
        fv_man_section("DESCRIPTION");
        fv_man_text(command.description);
        fv_man_section("OPTIONS");
        for (const Option &option : options)
            fv_man_item((std::string("--") + option.name).c_str(), option.value, option.help);
        fv_man_item("--help", nullptr, "list the options");
        fv_man_item("--man", nullptr, "print this page");
        fv_man_section("EXAMPLES");
        fv_man_example(command.examples);
    }
    fv_man_reference("fovea-calibrate", nullptr, true);
    for (const Command &other : commands)
        if (std::strcmp(other.name, name) != 0)
            fv_man_reference("fovea-calibrate", other.name, false);
    putchar('\n');
}

} // namespace

bool options_parse(int argc, char **argv, const std::vector<Option> &options, const char *operands,
                   size_t operand_count, std::vector<std::string> &found, int *status)
{
    const char *command = argv[0];
    for (int i = 1; i < argc; i++) {
        const std::string word = argv[i];
        if (word == "--help" || word == "-h" || word == "--man") {
            (word == "--man" ? man_print : help_print)(command, options, operands);
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
        const std::string value = equals == std::string::npos ? argv[++i] : word.substr(equals + 1);
        if (option->all != nullptr)
            option->all->push_back(value);
        else
            *option->target = value;
    }
    if (found.size() == operand_count) return true;
    *status = fv_say_wrong("fovea-calibrate %s: found %zu operands, expected %zu%s%s", command,
                           found.size(), operand_count, operand_count > 0 ? ": " : "", operands);
    return false;
}

int views_check(const std::string &views, int usual, int least, int64_t &views_max)
{
    constexpr int most = 500;
    views_max = usual;
    if (views.empty() ||
        (fv_text_integer(views.c_str(), &views_max) && views_max >= least && views_max <= most))
        return FV_EXIT_OK;
    return fv_say_wrong("--views: found '%s', expected a number from %d to %d", views.c_str(),
                        least, most);
}

int files_check(const std::vector<NamedFile> &written, const std::vector<NamedFile> &read)
{
    std::vector<fv_file> outputs, inputs;
    std::vector<std::string> folders(read.size());
    for (const NamedFile &file : written)
        outputs.push_back({file.option, file.path.c_str()});
    for (size_t i = 0; i < read.size(); i++) {
        folders[i] = read[i].path + (read[i].source ? "/" : "");
        const bool is_uri = read[i].source && read[i].path.find(':') != std::string::npos;
        inputs.push_back({read[i].option, is_uri ? nullptr : folders[i].c_str()});
    }
    outputs.push_back({});
    inputs.push_back({});
    fovea_error why;
    const char *blame;
    if (fv_files_apart(outputs.data(), inputs.data(), &why) != FOVEA_OK)
        return fv_say_wrong("%s", why.text);
    for (const NamedFile &file : read) {
        struct fv_files_watch watch;
        if (!file.source || file.path.empty()) continue;
        fv_files_watch(&watch, outputs.data(), file.option, &why);
        visit_source(file.path, fv_files_visit, &watch);
        if (watch.status != FOVEA_OK) return fv_say_wrong("%s", why.text);
    }
    if (fv_files_writable(outputs.data(), &blame, &why) != FOVEA_OK)
        return fv_say_wrong("%s: %s", blame, why.text);
    return FV_EXIT_OK;
}

bool models_of(const std::string &text, std::vector<Model> &models)
{
    for (const Model model : {Model::radtan, Model::equidistant, Model::rational})
        if (text == "auto" || text == model_name(model)) models.push_back(model);
    return !models.empty();
}

std::string now_text()
{
    const std::time_t now = std::time(nullptr);
    std::tm parts;
    char text[32];
    gmtime_r(&now, &parts);
    std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
    return text;
}

} // namespace calibrate
