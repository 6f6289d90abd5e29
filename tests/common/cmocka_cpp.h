/* CMocka for C++ tests: its header declares one function without C linkage. Include OpenCV first:
 * CMocka defines a macro `fail`, which the C++ streams do not survive. */
#ifndef FOVEA_TESTS_CMOCKA_CPP_H
#define FOVEA_TESTS_CMOCKA_CPP_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

extern "C" {
#include <cmocka.h>
}

#endif
