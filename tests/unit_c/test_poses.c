/* The file of poses (src/plant_fmu/poses.c): what is read, and what every fault is answered with. */
#include "check.h"
#include "modes.h"
#include "poses.h"
#include "poses_file.h"

/* Two axes X and Z; grid Z (three cells) by X (two cells); 1 to 3 modes in a cell. */
enum { AXES = 2, WIDTH = 2 + 2 * AXES + 3, CELLS = 6, GRID = 2, BYTES_OF_HEAD = 8 + 8 * 3 };
static const char *const AXIS_NAMES[AXES] = {"X", "Z"};
static const size_t MODES[CELLS] = {2, 3, 1, 2, 3, 2};

static PosesFile file;
static Poses poses;
static char message[400];
static double *numbers;
static GridAxis grid[AXES];
static PoseCell *cell;
static const double **transfer;

static void give_back(void) {
    free(numbers);
    free(cell);
    free((void *)transfer);
    numbers = NULL;
    cell = NULL;
    transfer = NULL;
}

/* With memory of just the size that is asked for, so that sanitisers see a step beyond it. */
static bool read_file(void) {
    give_back();
    message[0] = '\0';
    numbers = malloc((poses_capacity(file.size) + 1) * sizeof *numbers);
    char *bytes = malloc(file.size + 1);
    memcpy(bytes, file.bytes, file.size);
    memset(grid, 0, sizeof grid);
    bool good = poses_read_grid(bytes, file.size, "poses.bin", AXES, numbers, grid, &poses, message, sizeof message);
    free(bytes);
    if (good) {
        cell = calloc(poses.cells, sizeof *cell);
        transfer = calloc(poses.cells * poses.grid_axes, sizeof *transfer);
        good = poses_read_cells(&poses, "poses.bin", AXIS_NAMES, cell, transfer, message, sizeof message);
    }
    return good;
}

static double entry(size_t c, size_t mode, size_t column) {
    if (column == MODES_FREQUENCY) {
        return mode == 0 ? 0 : 10.0 * (double)mode + (double)c;
    }
    if (column == MODES_DAMPING) {
        return mode == 0 ? 0 : 0.01 * (double)mode;
    }
    return 100.0 * (double)c + 10.0 * (double)mode + (double)column;
}

static double transferred(size_t g, size_t lower, size_t row, size_t column) {
    return 0.3 - 0.01 * (double)(g + lower) - 0.1 * (double)row + 0.07 * (double)column;
}

static void write_good(void) {
    file_begin(&file);
    FILE_ADD(&file, AXES, GRID, 3);
    FILE_ADD(&file, 1, 3, 0.01, 0.1, 0.3, 0.6, 0.2, 0.45);
    FILE_ADD(&file, 0, 2, 0, -0.5, 0.5, 0);
    for (size_t c = 0; c < CELLS; c++) {
        file_add(&file, (double)MODES[c]);
        for (size_t i = 0; i < MODES[c] * WIDTH; i++) {
            file_add(&file, entry(c, i / WIDTH, i % WIDTH));
        }
    }
    const size_t strides[GRID] = {2, 1};
    for (size_t g = 0; g < GRID; g++) {
        for (size_t c = 0; c + strides[g] < CELLS; c++) {
            for (size_t i = 0; (g == 0 || c % 2 == 0) && i < MODES[c] * MODES[c + strides[g]]; i++) {
                file_add(&file, transferred(g, c, i / MODES[c], i % MODES[c]));
            }
        }
    }
}

static void good_file(void) {
    write_good();
    CHECK(read_file());
    CHECK_TEXT(message, "");
    CHECK(poses.axes == AXES && poses.grid_axes == GRID && poses.cells == CELLS && poses.most_modes == 3);
    CHECK(grid[0].axis == 1 && grid[0].cells == 3 && grid[0].stride == 2);
    CHECK(grid[1].axis == 0 && grid[1].cells == 2 && grid[1].stride == 1);
    CHECK_EQUAL(grid[0].hysteresis, 0.01);
    CHECK_EQUAL(grid[0].centres[2], 0.6);
    CHECK_EQUAL(grid[0].boundaries[1], 0.45);
    CHECK_EQUAL(grid[1].boundaries[0], 0);
    for (size_t c = 0; c < CELLS; c++) {
        CHECK(cell[c].modes == MODES[c]);
        for (size_t i = 0; i < MODES[c] * WIDTH; i++) {
            CHECK_EQUAL(cell[c].values[i], entry(c, i / WIDTH, i % WIDTH));
        }
        CHECK((transfer[c] == NULL) == (c >= 4));
        CHECK((transfer[CELLS + c] == NULL) == (c % 2 == 1));
        for (size_t i = 0; c < 4 && i < MODES[c] * MODES[c + 2]; i++) {
            CHECK_EQUAL(transfer[c][i], transferred(0, c, i / MODES[c], i % MODES[c]));
        }
        for (size_t i = 0; c % 2 == 0 && i < MODES[c] * MODES[c + 1]; i++) {
            CHECK_EQUAL(transfer[CELLS + c][i], transferred(1, c, i / MODES[c], i % MODES[c]));
        }
    }
}

static void refuse(const char *where, const char *what) {
    CHECK(!read_file());
    CHECK_CONTAINS(message, where);
    CHECK_CONTAINS(message, what);
}

static void refuse_number(size_t at, double number, const char *where, const char *what) {
    write_good();
    file_put(&file, at, number);
    refuse(where, what);
}

static void faults_of_the_grid(void) {
    write_good();
    file.bytes[7] = '2';
    refuse("poses.bin: ", "does not begin with FSPOSES1");
    file.size = 0;
    refuse("poses.bin: ", "does not begin with FSPOSES1");
    write_good();
    file.size += 3;
    refuse("poses.bin: ", "a grid of poses has a multiple of 8");
    refuse_number(8, 3, "byte 8: ", "number of axes (those of axes.csv) is 3; allowed is 2");
    refuse_number(16, 0, "byte 16: ", "number of grid axes is 0; allowed are whole numbers from 1 to 2");
    refuse_number(16, 1.5, "byte 16: ", "number of grid axes is 1.5");
    refuse_number(16, 3, "byte 16: ", "number of grid axes is 3");
    refuse_number(24, 0, "byte 24: ", "largest number of modes is 0");
    refuse_number(24, 1e300, "byte 24: ", "largest number of modes is 1e+300");
    refuse_number(24, 4, "byte 24: ", "is said to be 4, but no cell has more than 3");
    refuse_number(32, 2, "byte 32: ", "index of a grid axis is 2; allowed are whole numbers from 0 to 1");
    refuse_number(32, -1, "byte 32: ", "index of a grid axis is -1");
    refuse_number(40, 0, "byte 40: ", "number of cells along a grid axis is 0");
    refuse_number(40, 1e9, "byte 40: ", "number of cells along a grid axis is 1000000000; allowed");
    refuse_number(48, -1e-6, "byte 48: ", "grid axis 0: the hysteresis is -1e-06 m; it must not be negative");
    refuse_number(64, 0.1, "byte 64: ", "grid axis 0: centre 1 is at 0.1 m, allowed is more than 0.1 m");
    refuse_number(64, 0.7, "byte 72: ", "grid axis 0: centre 2 is at 0.6 m, allowed is more than 0.7 m");
    refuse_number(80, 0.3, "byte 80: ", "boundary 0 is at 0.3 m, allowed is between its centres, 0.1 m and 0.3 m");
    refuse_number(88, 0.2, "byte 88: ", "boundary 1 is at 0.2 m, allowed is between its centres, 0.3 m and 0.6 m");
    refuse_number(96, 1, "byte 96: ", "axis 1 is grid axis 0 and 1; allowed is once");
    refuse_number(48, (double)NAN, "byte 48: ", "nan is no finite number");
    write_good();
    file_put(&file, file.size - 8, -(double)INFINITY);
    refuse("byte ", "inf is no finite number");
}

static void faults_of_cells(void) {
    const size_t first = 8 + 8 * (3 + 8 + 6); /* number of modes of cell 0 */
    const size_t second_mode = first + 8 * (1 + WIDTH);
    refuse_number(first, 4, "byte 144: ", "cell 0 (Z 0.1 m, X -0.5 m): number of modes is 4; allowed");
    refuse_number(first, 0, "byte 144: ", "number of modes is 0");
    refuse_number(second_mode, -20, "cell 0 (Z 0.1 m, X -0.5 m), mode 1: ", "frequency -20 Hz; it must not be");
    refuse_number(second_mode + 8, -0.1, "mode 1: ", "damping ratio -0.1; it must not be negative");
    refuse_number(second_mode, 0, "mode 1: ", "damping ratio 0.01 at frequency 0 Hz; a rigid mode must have none");
    write_good();
    file_put(&file, first + 8 * 3, 0); /* n_X in both modes */
    file_put(&file, second_mode + 8 * 2, 0);
    refuse("cell 0 (Z 0.1 m, X -0.5 m): ", "n_X is 0 in every mode");
    write_good();
    file_put(&file, first + 8 * (1 + 2 + 6), 0); /* x_Z */
    file_put(&file, second_mode + 8 * (2 + 6), 0);
    refuse("cell 0 (Z 0.1 m, X -0.5 m): ", "x_Z is 0 in every mode");
    write_good();
    for (size_t i = 0; i < 3; i++) { /* the tool may stand still */
        file_put(&file, first + 8 * (1 + 2 + AXES + i), 0);
        file_put(&file, second_mode + 8 * (2 + AXES + i), 0);
    }
    CHECK(read_file());
}

static void faults_of_transfers(void) {
    const size_t modes = 2 + 3 + 1 + 2 + 3 + 2, first = 8 + 8 * (3 + 8 + 6 + CELLS + modes * WIDTH);
    refuse_number(first + 8, 1.1, "transfer from cell 0 (Z 0.1 m, X -0.5 m) to cell 2: row 0 has the length 1.1",
                  "a change between orthonormal bases has 1 at most");
    write_good();
    for (size_t i = 0; i < 6; i++) { /* cell 1 to cell 3: 2 rows, 3 columns; every row is short enough */
        file_put(&file, first + 8 * (2 + i), i % 3 == 1 ? 0.9 : 0);
    }
    refuse("transfer from cell 1 (Z 0.1 m, X 0.5 m) to cell 3: ", "column 1 has the length 1.27");
    write_good();
    file_add(&file, 0);
    refuse("byte ", "1 numbers too many: nothing may follow the last transfer");
}

/* Every file that ends too early, and files with bits changed: refused or read, without a step beyond the memory. */
static void damaged_files(void) {
    write_good();
    const size_t whole = file.size;
    for (size_t size = 0; size < whole; size++) {
        write_good();
        file.size = size;
        CHECK(!read_file());
        CHECK(message[0] != '\0');
    }
    uint64_t random = 12345;
    int read = 0;
    for (int i = 0; i < 20000; i++) {
        write_good();
        for (uint64_t changes = 1 + random % 3; changes > 0; changes--) {
            random = random * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
            const size_t at = (size_t)(random >> 33) % (random >> 20 & 1 ? whole : 160);
            file.bytes[at] = (char)(file.bytes[at] ^ (char)(random >> 50));
        }
        const bool good = read_file();
        CHECK(good == (message[0] == '\0'));
        read += good;
    }
    CHECK(read > 0); /* a shape may be any number */
}

static void messages_fit(void) {
    write_good();
    file_put(&file, 24, 4);
    for (size_t size = 1; size < 60; size++) {
        char *text = malloc(size);
        numbers = realloc(numbers, (poses_capacity(file.size) + 1) * sizeof *numbers);
        file_put(&file, 8, 7);
        CHECK(!poses_read_grid(file.bytes, file.size, "poses.bin", AXES, numbers, grid, &poses, text, size));
        CHECK(strlen(text) < size);
        free(text);
    }
}

int main(void) {
    good_file();
    faults_of_the_grid();
    faults_of_cells();
    faults_of_transfers();
    damaged_files();
    messages_fit();
    give_back();
    return CHECK_RESULT;
}
