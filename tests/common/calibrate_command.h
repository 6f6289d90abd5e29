/* A command of fovea-calibrate, called as its main does. */
#ifndef FOVEA_TESTS_COMMON_CALIBRATE_COMMAND_H
#define FOVEA_TESTS_COMMON_CALIBRATE_COMMAND_H

#include <string>
#include <vector>

/* `words` begin with the command's name. Returns its exit status. */
inline int run_command(int (*command)(int, char **), std::vector<std::string> words)
{
    std::vector<char *> arguments;
    for (std::string &word : words)
        arguments.push_back(word.data());
    arguments.push_back(nullptr);
    return command((int)words.size(), arguments.data());
}

#endif
