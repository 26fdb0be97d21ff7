/* generate.c - scatter-generate: a cumulus cloud of any number of Gaussians, or rising puffs of smoke
   as a sequence of voxel files; the scene file goes to the output. MIT licence, see LICENSE.

       build/scatter-generate 1000  > examples/scenes/cumulus_1000.scatter (committed)
       build/scatter-generate 27000 > build/scenes/cumulus_27000.scatter    (1 MB, made when needed)
       build/scatter-generate puffs 12 build/scenes/puffs > build/scenes/puffs.scatter
           and the voxels of 12 frames, build/scenes/puffs_0000_32x48x32_u8.raw and on

   The cloud grows as cumulus does: puffs sit on puffs. Each new one is placed on the surface of an
   older one, and is smaller. The same count gives the same file on every run: the random numbers
   are the program's own, and all numbers are rounded to four digits. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST = 1000000, FIRST = 14 }; /* puffs at most, and of the base */
enum { RISING = 5, NX = 32, NY = 48, NZ = 32 }; /* puffs of smoke at a time; voxels */

typedef struct puff {
    double x, y, z, radius;
} puff;

/* 0 <= x < 1; the generator of Numerical Recipes. */
static double uniform(void) {
    static uint64_t state = 12;
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (double)(state >> 40) / 16777216.0;
}

static double between(double low, double high) {
    return low + (high - low) * uniform();
}

/* Large puffs side by side, higher in the middle. */
static puff base_puff(void) {
    puff p;
    p.x = between(-2.4, 2.4);
    p.z = between(-1.2, 1.2);
    double middle = 1 - p.x * p.x / 6.5;
    p.radius = between(0.45, 0.6) + 0.45 * middle;
    p.y = between(0.1, 1.0) * middle;
    return p;
}

/* On the surface of an older puff, more often above than below. */
static puff grown_puff(const puff *parent) {
    puff p;
    double up = between(-0.35, 1), around = between(0, 6.283185307179586), side = sqrt(1 - up * up);
    p.radius = parent->radius * between(0.42, 0.72);
    p.x = parent->x + parent->radius * side * cos(around);
    p.y = parent->y + parent->radius * up;
    p.z = parent->z + parent->radius * side * sin(around);
    if (p.y < 0) /* clouds are flat below */
        p.y *= 0.2;
    return p;
}

/* A parent among the puffs so far: older ones, which are larger, have more children. */
static int choose_parent(int count) {
    return (int)(count * pow(uniform(), 1.6));
}

static void print_header(int count) {
    printf("# A cumulus cloud of %d Gaussians: the cost of many, which a density volume makes "
           "constant.\n",
           count);
    printf("# smooth\n# Written by scatter-generate %d.\n", count);
    printf("image 640 480\ncamera perspective 0 1.2 9  0 1.15 0  0 1 0  34\n");
    printf("medium 3.4 3.45 3.6  0.99 0.99 0.99\nphase hg 0.1\n");
    printf("light directional 0.75 -0.6 -0.55  15 13.5 11\nlight directional -0.2 -1 -0.1  1.2 1.8 "
           "2.8\n");
    printf("background 0.06 0.14 0.36\n");
}

/* A Gaussian with half of its density at about 0.6 of the radius. The smaller the puff, the denser,
   so that it shows; the more there are, the thinner each. */
static void print_puff(const puff *p, int count) {
    double a = 1.35 / p->radius, c = 0.28 / p->radius * pow(1000.0 / count, 0.35);
    printf("gaussian %.4f %.4f %.4f  %.4f %.4f\n", p->x, p->y, p->z, a, c);
}

static int print_cloud(int count) {
    puff *puffs = (puff *)malloc((size_t)count * sizeof *puffs);
    if (!puffs)
        return 1;
    print_header(count);
    for (int i = 0; i < count; i++) {
        puffs[i] = i < FIRST ? base_puff() : grown_puff(&puffs[choose_parent(i)]);
        print_puff(&puffs[i], count);
    }
    free(puffs);
    return fflush(stdout) ? 1 : 0;
}

/* Puffs that rise, swing, widen and thin out, at a time of 0..1; at 1 all is as at 0. x, y, z in voxels. */
static double smoke_at(double time, int x, int y, int z) {
    double sum = 0;
    for (int i = 0; i < RISING; i++) {
        double age = fmod(time + (double)i / RISING, 1), radius = 3 + 6 * age;
        double dx = x + 0.5 - NX / 2.0 - 4 * age * sin(9 * age + i);
        double dy = y + 0.5 - NY * (0.1 + 0.75 * age);
        double dz = z + 0.5 - NZ / 2.0 - 4 * age * cos(7 * age + 2 * i);
        double square = (dx * dx + 1.6 * dy * dy + dz * dz) / (radius * radius);
        sum += 0.9 * fmin(8 * age, 1) * (1 - age) * exp(-square);
    }
    return fmin(sum, 1);
}

/* One frame; bytes below 2 are left out, so that there is empty space. */
static int write_smoke(const char *prefix, int frame, double time) {
    static unsigned char voxels[NZ][NY][NX];
    char path[1000];
    for (int z = 0; z < NZ; z++)
        for (int y = 0; y < NY; y++)
            for (int x = 0; x < NX; x++) {
                int value = (int)(255 * smoke_at(time, x, y, z));
                voxels[z][y][x] = (unsigned char)(value < 2 ? 0 : value);
            }
    snprintf(path, sizeof path, "%s_%04d_%dx%dx%d_u8.raw", prefix, frame, NX, NY, NZ);
    FILE *file = fopen(path, "wb");
    int failed = !file || fwrite(voxels, sizeof voxels, 1, file) != 1;
    return (file && fclose(file)) || failed;
}

static int print_smoke(int frames, const char *prefix) {
    const char *slash = strrchr(prefix, '/');
    for (int i = 0; i < frames; i++)
        if (write_smoke(prefix, i, (double)i / frames))
            return 1;
    printf("# Rising puffs of smoke, the first of %d volumes.\n", frames);
    printf("# Written by scatter-generate puffs %d.\n", frames);
    printf("image 320 480\ncamera perspective 0 1.1 5  0 1.4 0  0 1 0  35\n");
    printf("medium 6 6.2 6.5  0.9 0.9 0.9\nphase hg 0.3\n");
    printf("grid %s_0000_%dx%dx%d_u8.raw  -1 0 -1  1 3 1  1\n", slash ? slash + 1 : prefix, NX, NY,
           NZ);
    printf("light directional 0.8 -0.5 -0.3  6 5.2 4\nlight directional -0.3 -1 -0.2  0.5 0.7 1\n");
    printf("background 0.1 0.14 0.22\n");
    return fflush(stdout) ? 1 : 0;
}

int main(int arguments, char **argument) {
    int smoke = arguments == 4 && strcmp(argument[1], "puffs") == 0;
    int count = arguments > 1 ? atoi(argument[smoke ? 2 : 1]) : 0;
    if (smoke && count >= 1 && count <= 9999)
        return print_smoke(count, argument[3]);
    if (arguments == 2 && count >= FIRST && count <= MOST)
        return print_cloud(count);
    fprintf(stderr, "usage: scatter-generate COUNT, %d to %d Gaussians\n", FIRST, MOST);
    fprintf(stderr, "       scatter-generate puffs FRAMES PREFIX, 1 to 9999 frames\n");
    return 2;
}
