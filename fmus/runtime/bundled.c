#include "bundled.h"

#include "platform.h"

#if defined(__x86_64__) || defined(_M_X64)
#define PROCESSOR "x86_64"
#elif defined(__aarch64__) || defined(_M_ARM64)
#define PROCESSOR "aarch64"
#else
#define PROCESSOR "other"
#endif
#if defined(_WIN32)
#define PLATFORM PROCESSOR "-windows"
#define PROGRAM "unit.exe"
#elif defined(__APPLE__)
#define PLATFORM PROCESSOR "-darwin"
#define PROGRAM "unit"
#else
#define PLATFORM PROCESSOR "-linux"
#define PROGRAM "unit"
#endif

static bool exists(const Text *path) { return platform_exists(text_of(path)); }

Bundle bundled_interpreter(const char *resources, char **program, Text *fault) {
    Text folder = {0}, path = {0};
    Bundle bundled = NO_BUNDLE;
    text_add(&folder, "%s/standalone", resources);
    text_add(&path, "%s/" PLATFORM "/" PROGRAM, text_of(&folder));
    *program = NULL;
    if (exists(&path)) {
        bundled = platform_make_executable(text_of(&path), fault) ? BUNDLED : UNUSABLE_BUNDLE;
        if (bundled == BUNDLED) *program = copy_of(text_of(&path));
    } else if (exists(&folder)) {
        bundled = UNUSABLE_BUNDLE;
        text_add(fault, "the unit brings its interpreter for another platform than this one, " PLATFORM ": there is no "
                        "%s. Cure: take the unit that was built here, or one that was built without --standalone",
                 text_of(&path));
    }
    text_clear(&folder);
    text_clear(&path);
    return bundled;
}
