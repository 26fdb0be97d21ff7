/* generate.c - scatter-generate: a cumulus cloud of any number of Gaussians, as a scene file. MIT
   licence, see LICENSE.

       build/scatter-generate 1000  > examples/scenes/cumulus_1000.scatter (committed)
       build/scatter-generate 27000 > build/scenes/cumulus_27000.scatter    (1 MB, made when needed)

   The cloud grows as cumulus does: puffs sit on puffs. Each new one is placed on the surface of an
   older one, and is smaller. The same count gives the same file on every run: the random numbers
   are the program's own, and all numbers are rounded to four digits. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

enum { MOST = 1000000, FIRST = 14 }; /* puffs at most, and of the base */

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

int main(int arguments, char **argument) {
    int count = arguments == 2 ? atoi(argument[1]) : 0;
    if (count < FIRST || count > MOST) {
        fprintf(stderr, "usage: scatter-generate COUNT, %d to %d Gaussians\n", FIRST, MOST);
        return 2;
    }
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
