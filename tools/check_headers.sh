#!/bin/sh
# Every public header compiles alone, as C and as C++.
set -eu
for header in include/fovea/*.h; do
    ${CC:-gcc} -std=c11 -Wall -Wextra -Werror -Iinclude -fsyntax-only -x c "$header"
    ${CXX:-g++} -std=c++17 -Wall -Wextra -Werror -Iinclude -fsyntax-only -x c++ "$header"
done
echo "headers: ok"
