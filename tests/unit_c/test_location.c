/* Resource locations as importers spell them, and reading files from there. */
#include "files.h"
#include "location.h"

#include <stdlib.h>

#include "toy.h"

static void means(const char *location, bool drive_letters, const char *expected) {
    char path[256] = "untouched";
    bool good = location_path(location, drive_letters, path);
    CHECK(good == (expected != NULL));
    if (expected != NULL) {
        CHECK_TEXT(path, expected);
    }
}

static void on_any_system(bool drives) {
    means("file:///home/a/resources", drives, "/home/a/resources");
    means("file:/home/a/resources", drives, "/home/a/resources");
    means("file://localhost/home/a/resources", drives, "/home/a/resources");
    means("FILE://LocalHost/home/a", drives, "/home/a");
    means("file:///home/a/resources/", drives, "/home/a/resources");
    means("file:///home/a/resources//", drives, "/home/a/resources");
    means("file:///home/with%20space/%C3%A4%c3%b6", drives, "/home/with space/\xc3\xa4\xc3\xb6");
    means("file:///home/with space/\xc3\xa4", drives, "/home/with space/\xc3\xa4"); /* not encoded, as it must be */
    means("file:///100%/a%2", drives, "/100%/a%2");                                 /* nor this */
    means("file:///a%zz%00b%25c", drives, "/a%zz%00b%c");
    means("file:///a+b#c?d", drives, "/a+b#c?d");
    means("file://server/share/a", drives, "//server/share/a");
    means("file:///", drives, "/");
    means("file:relative/a", drives, "relative/a");
    means("/home/a b/100%20/", drives, "/home/a b/100%20"); /* a path is no URI: nothing to decode */
    means("relative/a", drives, "relative/a");
    means("/", drives, "/");
    means("", drives, NULL);
    means("file:", drives, NULL);
    means("file://", drives, NULL);
    means("file://localhost", drives, NULL);
    means("http://host/a", drives, NULL);
    means("jar:file:/a.fmu!/resources", drives, NULL);
    means("fmu+x.1-2:/a", drives, NULL);
    means("a b:c", drives, "a b:c"); /* no scheme has a space */
}

static void where_drives_have_letters(void) {
    means("file:///C:/Users/a%20b/resources", true, "C:/Users/a b/resources");
    means("file:/C:/Users/a", true, "C:/Users/a");
    means("file:///c%3A/Users", true, "/c:/Users");
    means("file://C:/Users/a", true, "C:/Users/a");
    means("file://localhost/C:/a/", true, "C:/a");
    means("C:\\Users\\a b\\resources\\", true, "C:\\Users\\a b\\resources");
    means("C:/", true, "C:/");
    means("file:///C:/", true, "C:/");
    means("\\\\server\\share\\", true, "\\\\server\\share");
}

static void where_they_have_not(void) {
    means("file:///C:/a", false, "/C:/a");
    means("/a\\", false, "/a\\");
    means("C:/a/", false, "C:/a");
}

static void write_file(const char *path, const char *bytes, size_t size) {
    FILE *file = fopen(path, "wb");
    CHECK(file != NULL && fwrite(bytes, 1, size, file) == size);
    if (file != NULL) {
        fclose(file);
    }
}

/* argument: a directory to write to */
static void files(const char *directory) {
    Log log = {.count = 0};
    Unit *unit = toy_in(PHASE_INSTANTIATED, &log);
    char path[2048];
    size_t size = 99;
    const char *name = "Achse \xc3\x84 100%.csv";
    snprintf(path, sizeof path, "%s/%s", directory, name);
    write_file(path, "a\0b\r\n", 5);
    char *bytes = file_read(unit, directory, name, &size);
    CHECK(bytes != NULL && size == 5 && memcmp(bytes, "a\0b\r\n", 6) == 0);
    unit_free(unit, bytes);
    bytes = file_read(unit, NULL, path, NULL);
    CHECK(bytes != NULL && memcmp(bytes, "a\0b\r\n", 6) == 0);
    unit_free(unit, bytes);
    write_file(path, "", 0);
    bytes = file_read(unit, directory, name, &size);
    CHECK(bytes != NULL && size == 0 && bytes[0] == '\0');
    unit_free(unit, bytes);

    /* sizes about those of the pieces it is read in */
    static char large[40000];
    for (size_t k = 0; k < sizeof large; k++) {
        large[k] = (char)('a' + k % 23);
    }
    const size_t sizes[] = {16382, 16383, 16384, 16385, 32767, 32768, 40000};
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
        write_file(path, large, sizes[k]);
        bytes = file_read(unit, directory, name, &size);
        CHECK(bytes != NULL && size == sizes[k] && memcmp(bytes, large, size) == 0 && bytes[size] == '\0');
        unit_free(unit, bytes);
    }
    remove(path);
    CHECK(file_read(unit, directory, name, &size) == NULL);
    CHECK(file_read(unit, NULL, "", &size) == NULL);
    CHECK(file_read(unit, NULL, directory, &size) == NULL); /* a directory can be opened, but not read */
    CHECK(log.count == 0);
    fmi2FreeInstance(unit);
    CHECK(memory.held == 0);
}

int main(int count, char *arguments[]) {
    on_any_system(false);
    on_any_system(true);
    where_drives_have_letters();
    where_they_have_not();
    files(count > 1 ? arguments[1] : getenv("TMPDIR") != NULL ? getenv("TMPDIR") : "/tmp");
    return CHECK_RESULT;
}
