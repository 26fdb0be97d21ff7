/* cmocka.h - the few macros of cmocka that the tests use, for -m32, where there is no cmocka. */
#ifndef TINY_CMOCKA_H
#define TINY_CMOCKA_H

#include <math.h>
#include <setjmp.h>
#include <stdio.h>
#include <string.h>

struct CMUnitTest {
    const char *name;
    void (*function)(void **state);
};

static jmp_buf tiny_return;

/* Leaves the test with 1 (failed) or 2 (skipped). */
static inline void tiny_leave(int how, const char *what, const char *file, int line) {
    fprintf(stderr, "%s:%d: %s\n", file, line, what);
    longjmp(tiny_return, how);
}

#define tiny_check(good, what) ((good) ? (void)0 : tiny_leave(1, what, __FILE__, __LINE__))
#define assert_true(c) tiny_check(c, #c)
#define assert_false(c) tiny_check(!(c), "not " #c)
#define assert_null(p) tiny_check((p) == NULL, #p " is NULL")
#define assert_non_null(p) tiny_check((p) != NULL, #p " is not NULL")
#define assert_int_equal(a, b) tiny_check((long long)(a) == (long long)(b), #a " equals " #b)
#define assert_int_not_equal(a, b) tiny_check((long long)(a) != (long long)(b), #a " is not " #b)
#define assert_ptr_equal(a, b) tiny_check((a) == (b), #a " equals " #b)
#define assert_string_equal(a, b) tiny_check(strcmp(a, b) == 0, #a " equals " #b)
#define assert_memory_equal(a, b, n) tiny_check(memcmp(a, b, n) == 0, #a " equals " #b)
#define assert_float_equal(a, b, e) \
    tiny_check(fabs((double)(a) - (double)(b)) <= (double)(e), #a " equals " #b)
#define fail_msg(...) (fprintf(stderr, __VA_ARGS__), tiny_leave(1, "failed", __FILE__, __LINE__))
#define fail() tiny_leave(1, "failed", __FILE__, __LINE__)
#define skip() tiny_leave(2, "skipped", __FILE__, __LINE__)
#define print_message printf
#define cmocka_unit_test(f) {#f, f}
#define cmocka_run_group_tests(tests, before, after) \
    ((void)(before), (void)(after), tiny_run(tests, sizeof(tests) / sizeof((tests)[0])))

/* Prints what cmocka prints, as far as tests/run.sh reads it; returns the number of failures. */
static inline int tiny_run(const struct CMUnitTest *tests, size_t count) {
    static const char *const said[] = {"[       OK ]", "[  FAILED  ]", "[  SKIPPED ]"};
    unsigned number[3] = {0, 0, 0};
    size_t i;
    printf("[==========] Running %u test(s).\n", (unsigned)count);
    for (i = 0; i < count; i++) {
        void *state = NULL;
        volatile int how = setjmp(tiny_return);
        if (how == 0)
            tests[i].function(&state);
        number[how]++;
        printf("%s %s\n", said[how], tests[i].name);
    }
    printf("[  FAILED  ] %u test(s).\n[  SKIPPED ] %u test(s).\n", number[1], number[2]);
    return (int)number[1];
}

#endif /* TINY_CMOCKA_H */
