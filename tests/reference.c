/* reference.c - the slow and exact answer; see reference.h. MIT licence.

   Chapters: vectors, density, depth, phase, lights, path, breaks, ray, surface, image.

   How the integral over a ray is made safe and affordable:
   - t = t0 + d sinh u around a local light (d^2: square of its distance to the ray, plus R^2)
     removes 1/r^2; a directional light is integrated in t itself.
   - The range of u is broken where the integrand or its slope jumps and where something could be
     overlooked: faces of boxes, edges of boxes as seen from the light, narrow Gaussians and their
     shadows, spot cones, layers of fog, and the edges of shadows, found by 2048 probes and
     bisection. A shadow thinner than the spacing of the probes is missed.
   - Every lit part is integrated adaptively with GSL's 21 Gauss-Kronrod points on an interval,
     to an estimated 1e-8 of the whole. A ray that crosses more than 48 voxel planes gets
     Gauss-Legendre points between all crossings instead; the optical depths at these points are
     as exact as everywhere.
   - Along a ray a Gaussian counts where it exceeds exp(-28) = 7e-13 of its peak; fog ends where
     its own transmittance fell below that, or 1e7 m away. */
#include "reference.h"

#include <gsl/gsl_errno.h>
#include <gsl/gsl_integration.h>
#include <math.h>
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846
#define NEGLIGIBLE 28.0 /* exp(-28) = 7e-13 */
#define FAR_END 1e7     /* m */
#define INTERVALS 4000  /* of one adaptive quadrature */

/* ---------------------------------------------------------------------- >>vectors */

typedef struct vec {
    double x[3];
} vec;

/* The points o + u t, t0 <= t <= t1; |u| = 1. */
typedef struct line {
    vec o, u;
    double t0, t1;
} line;

static vec from(scatter_vec3 v) {
    vec r = {{(double)v.x, (double)v.y, (double)v.z}};
    return r;
}

static scatter_vec3 to_float(vec v) {
    scatter_vec3 r;
    r.x = (float)v.x[0];
    r.y = (float)v.x[1];
    r.z = (float)v.x[2];
    return r;
}

/* a + b s */
static vec along(vec a, vec b, double s) {
    vec r = {{a.x[0] + b.x[0] * s, a.x[1] + b.x[1] * s, a.x[2] + b.x[2] * s}};
    return r;
}

static vec minus(vec a, vec b) {
    return along(a, b, -1.0);
}

static vec scaled(vec a, double s) {
    vec r = {{a.x[0] * s, a.x[1] * s, a.x[2] * s}};
    return r;
}

static double dot(vec a, vec b) {
    return a.x[0] * b.x[0] + a.x[1] * b.x[1] + a.x[2] * b.x[2];
}

static vec cross(vec a, vec b) {
    vec r = {{a.x[1] * b.x[2] - a.x[2] * b.x[1], a.x[2] * b.x[0] - a.x[0] * b.x[2],
              a.x[0] * b.x[1] - a.x[1] * b.x[0]}};
    return r;
}

static double length(vec a) {
    return sqrt(dot(a, a));
}

static vec unit(vec a) {
    return scaled(a, 1.0 / length(a));
}

static line segment(vec p, vec q) {
    vec d = minus(q, p);
    double s = length(d);
    line l = {{{0, 0, 0}}, {{0, 0, 1}}, 0, 0};
    l.o = p;
    l.t1 = s;
    if (s > 0)
        l.u = scaled(d, 1.0 / s);
    return l;
}

static double clamp(double x, double low, double high) {
    return x < low ? low : x > high ? high : x;
}

static int inside(const scatter_box *box, vec x) {
    vec a = from(box->min), b = from(box->max);
    int i, in = 1;
    for (i = 0; i < 3; i++)
        in = in && x.x[i] >= a.x[i] && x.x[i] <= b.x[i];
    return in;
}

/* Shortens the line to its part in the box; 0 if nothing is left. */
static int clip(line *l, const scatter_box *box) {
    vec a = from(box->min), b = from(box->max);
    int i;
    for (i = 0; i < 3; i++) {
        double o = l->o.x[i], u = l->u.x[i];
        if (u == 0) {
            if (o < a.x[i] || o > b.x[i])
                return 0;
        } else {
            double in = ((u > 0 ? a.x[i] : b.x[i]) - o) / u;
            double out = ((u > 0 ? b.x[i] : a.x[i]) - o) / u;
            l->t0 = fmax(l->t0, in);
            l->t1 = fmin(l->t1, out);
        }
    }
    return l->t0 < l->t1;
}

/* ---------------------------------------------------------------------- >>density */

static double height_density(const scatter_height *h, double y) {
    return h->density > 0 ? (double)h->density * exp(((double)h->y0 - y) / (double)h->scale)
                          : 0.0;
}

static double gaussian_density(const scatter_gaussian *g, vec x) {
    vec d = minus(x, from(g->center));
    double a = (double)g->a;
    return (double)g->c * exp(-a * a * dot(d, d));
}

/* Lattice coordinates: the centre of voxel (i,j,k) is at (i,j,k). */
typedef struct lattice {
    int n[3];
    vec low, rate; /* lattice = (x - low) rate - 1/2 */
} lattice;

static lattice lattice_of(const scatter_grid *g) {
    vec high = from(g->box.max);
    lattice r;
    int i;
    r.n[0] = g->nx;
    r.n[1] = g->ny;
    r.n[2] = g->nz;
    r.low = from(g->box.min);
    for (i = 0; i < 3; i++)
        r.rate.x[i] = r.n[i] / (high.x[i] - r.low.x[i]);
    return r;
}

static vec lattice_point(const lattice *r, vec x) {
    vec q;
    int i;
    for (i = 0; i < 3; i++)
        q.x[i] = (x.x[i] - r->low.x[i]) * r->rate.x[i] - 0.5;
    return q;
}

/* Eight voxels between which the density is trilinear. */
typedef struct cell {
    double value[8], base[3];
    int n[3], empty;
} cell;

static cell cell_at(const scatter_grid *g, const lattice *r, vec q) {
    size_t low[3], high[3], nx = (size_t)g->nx, ny = (size_t)g->ny;
    cell c;
    int i;
    c.empty = 1;
    for (i = 0; i < 3; i++) {
        int last = r->n[i] - 1;
        int k = (int)clamp(q.x[i], 0.0, (double)last);
        k = k == last && k > 0 ? k - 1 : k;
        low[i] = (size_t)k;
        high[i] = (size_t)(k < last ? k + 1 : k);
        c.base[i] = (double)k;
        c.n[i] = r->n[i];
    }
    for (i = 0; i < 8; i++) {
        size_t x = i & 1 ? high[0] : low[0], y = i & 2 ? high[1] : low[1];
        size_t z = i & 4 ? high[2] : low[2];
        c.value[i] = (double)g->density[x + nx * (y + ny * z)];
        c.empty = c.empty && c.value[i] == 0;
    }
    return c;
}

static double cell_value(const cell *c, vec q) {
    double f[3], v[4];
    int i;
    for (i = 0; i < 3; i++)
        f[i] = clamp(q.x[i], 0.0, (double)(c->n[i] - 1)) - c->base[i];
    for (i = 0; i < 4; i++)
        v[i] = c->value[2 * i] + f[0] * (c->value[2 * i + 1] - c->value[2 * i]);
    v[0] += f[1] * (v[1] - v[0]);
    v[2] += f[1] * (v[3] - v[2]);
    return v[0] + f[2] * (v[2] - v[0]);
}

static double grid_scale(const scatter_grid *g) {
    return g->scale == 0.0f ? 1.0 : (double)g->scale;
}

static double grid_density(const scatter_grid *g, vec x) {
    lattice r = lattice_of(g);
    vec q = lattice_point(&r, x);
    cell c;
    if (!inside(&g->box, x))
        return 0;
    c = cell_at(g, &r, q);
    return grid_scale(g) * cell_value(&c, q);
}

static double density(const scatter_medium *m, vec x) {
    double d = (double)m->constant;
    size_t i;
    if (m->bounded && !inside(&m->bounds, x))
        return 0;
    for (i = 0; i < m->height_count; i++)
        d += height_density(&m->heights[i], x.x[1]);
    for (i = 0; i < m->gaussian_count; i++)
        d += gaussian_density(&m->gaussians[i], x);
    for (i = 0; i < m->grid_count; i++)
        d += grid_density(&m->grids[i], x);
    return d;
}

double reference_density(const scatter_medium *medium, scatter_vec3 x) {
    return density(medium, from(x));
}

/* ---------------------------------------------------------------------- >>depth */

/* erf(y) - erf(x), x <= y, to nearly full relative precision: erfc in the tails, five
   Gauss-Legendre points where the difference would cancel. */
static double erf_difference(double x, double y) {
    static const double node[3] = {0.0, 0.5384693101056831, 0.9061798459386640};
    static const double weight[3] = {0.5688888888888889, 0.4786286704993665, 0.2369268850561891};
    double h = 0.5 * (y - x), m = 0.5 * (x + y), sum;
    int i;
    if (2 * h * (1 + fabs(x) + fabs(y)) > 0.1)
        return x > 0 ? erfc(x) - erfc(y) : y < 0 ? erfc(-y) - erfc(-x) : erf(y) - erf(x);
    sum = weight[0] * exp(-m * m);
    for (i = 1; i < 3; i++) {
        double lo = m - h * node[i], hi = m + h * node[i];
        sum += weight[i] * (exp(-lo * lo) + exp(-hi * hi));
    }
    return h * sum * 2.0 / sqrt(PI);
}

/* Where a line passes a Gaussian: the density there is peak exp(-a^2 (t - m)^2). */
typedef struct passage {
    double a, m, miss, peak; /* miss: a^2 times the squared distance of line and centre */
} passage;

/* All but the peak. */
static passage approach(const scatter_gaussian *g, vec o, vec u) {
    vec d = minus(from(g->center), o);
    passage p;
    p.a = (double)g->a;
    p.m = dot(d, u);
    d = along(d, u, -p.m);
    p.miss = p.a * p.a * dot(d, d);
    p.peak = 0;
    return p;
}

static passage pass(const scatter_gaussian *g, vec o, vec u) {
    passage p = approach(g, o, u);
    p.peak = (double)g->c * exp(-p.miss);
    return p;
}

static double passage_depth(const passage *p, double t0, double t1) {
    double part = erf_difference(p->a * (t0 - p->m), p->a * (t1 - p->m));
    return p->peak * 0.5 * sqrt(PI) / p->a * part;
}

static double gaussian_depth(const scatter_gaussian *g, const line *l) {
    passage p = pass(g, l->o, l->u);
    return passage_depth(&p, l->t0, l->t1);
}

/* Counted from the lower end, so that exp(-y/scale) only falls. */
static double height_depth(const scatter_height *h, const line *l) {
    double s = l->t1 - l->t0, dy = l->u.x[1], fall = fabs(dy) / (double)h->scale;
    double bottom = height_density(h, l->o.x[1] + dy * (dy > 0 ? l->t0 : dy < 0 ? l->t1 : 0));
    if (bottom == 0)
        return 0;
    return fall * s > 1e-300 ? bottom * -expm1(-fall * s) / fall : bottom * s;
}

/* Goes through a grid from one voxel-centre plane to the next. */
typedef struct walk {
    const scatter_grid *grid;
    lattice r;
    line l;
    vec q0, dq;   /* lattice coordinates along the line: q0 + t dq */
    int plane[3]; /* next plane to cross, per axis */
} walk;

static vec walk_point(const walk *w, double t) {
    return along(w->q0, w->dq, t);
}

/* 0 if the line misses the grid. */
static int walk_begin(walk *w, const scatter_grid *g, const line *l) {
    int i;
    w->grid = g;
    w->l = *l;
    if (!clip(&w->l, &g->box))
        return 0;
    w->r = lattice_of(g);
    w->q0 = lattice_point(&w->r, l->o);
    for (i = 0; i < 3; i++) {
        double q;
        w->dq.x[i] = l->u.x[i] * w->r.rate.x[i];
        q = clamp(w->q0.x[i] + w->dq.x[i] * w->l.t0, -1.0, (double)w->r.n[i]);
        w->plane[i] = w->dq.x[i] > 0 ? (int)floor(q) + 1 : (int)ceil(q) - 1;
    }
    return 1;
}

/* The next crossing after t, or the end of the walk. */
static double walk_next(walk *w, double t) {
    double next = w->l.t1;
    int i, axis = -1;
    for (i = 0; i < 3; i++) {
        if (w->dq.x[i] != 0 && w->plane[i] >= 0 && w->plane[i] < w->r.n[i]) {
            double crossing = (w->plane[i] - w->q0.x[i]) / w->dq.x[i];
            axis = crossing < next ? i : axis;
            next = fmin(crossing, next);
        }
    }
    if (axis >= 0)
        w->plane[axis] += w->dq.x[axis] > 0 ? 1 : -1;
    return fmax(next, t);
}

/* Depth of a piece without crossings: the density is a cubic of t, which two Gauss-Legendre
   points integrate exactly. */
static double walk_depth(const walk *w, double t0, double t1) {
    double m = 0.5 * (t0 + t1), h = 0.5 * (t1 - t0), s = h / sqrt(3.0);
    cell c = cell_at(w->grid, &w->r, walk_point(w, m));
    if (c.empty)
        return 0;
    return grid_scale(w->grid) * h *
           (cell_value(&c, walk_point(w, m - s)) + cell_value(&c, walk_point(w, m + s)));
}

static double grid_depth(const scatter_grid *g, const line *l) {
    walk w;
    double t, next, sum = 0;
    if (!walk_begin(&w, g, l))
        return 0;
    for (t = w.l.t0; t < w.l.t1; t = next) {
        next = walk_next(&w, t);
        sum += walk_depth(&w, t, next);
    }
    return sum;
}

/* Constant and height fog. */
static double fog_depth(const scatter_medium *m, const line *l) {
    double sum = m->constant > 0 ? (double)m->constant * (l->t1 - l->t0) : 0;
    size_t i;
    for (i = 0; i < m->height_count; i++)
        sum += height_depth(&m->heights[i], l);
    return sum;
}

static double depth(const scatter_medium *m, line l) {
    double sum;
    size_t i;
    if ((m->bounded && !clip(&l, &m->bounds)) || !(l.t0 < l.t1))
        return 0;
    sum = fog_depth(m, &l);
    for (i = 0; i < m->gaussian_count; i++)
        sum += gaussian_depth(&m->gaussians[i], &l);
    for (i = 0; i < m->grid_count; i++)
        sum += grid_depth(&m->grids[i], &l);
    return sum;
}

double reference_optical_depth(const scatter_medium *medium, scatter_vec3 p, scatter_vec3 q) {
    return depth(medium, segment(from(p), from(q)));
}

static line endless(vec o, vec u) {
    line l;
    l.o = o;
    l.u = u;
    l.t0 = 0;
    l.t1 = INFINITY;
    return l;
}

double reference_source_depth(const scatter_medium *medium, const scatter_source *source,
                              scatter_vec3 x) {
    if (source->directional)
        return depth(medium, endless(from(x), scaled(unit(from(source->direction)), -1.0)));
    return reference_optical_depth(medium, source->position, x);
}

/* ---------------------------------------------------------------------- >>depth by quadrature */

typedef struct probe {
    const scatter_medium *medium;
    line l;
} probe;

typedef struct quadrature {
    gsl_integration_workspace *smooth;
    gsl_integration_cquad_workspace *rough;
} quadrature;

static double probe_density(double t, void *data) {
    const probe *p = data;
    return density(p->medium, along(p->l.o, p->l.u, t));
}

static void add_break(double *t, size_t *count, const line *l, double value) {
    if (value > l->t0 && value < l->t1)
        t[(*count)++] = value;
}

static void box_breaks(double *t, size_t *count, const line *l, const scatter_box *box) {
    line part = *l;
    if (clip(&part, box)) {
        add_break(t, count, l, part.t0);
        add_break(t, count, l, part.t1);
    }
}

static int compare(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Where adaptive quadrature could overlook or stumble over something: 5 per term at most. */
static size_t probe_breaks(const probe *p, double *t) {
    const scatter_medium *m = p->medium;
    size_t i, count = 0;
    t[count++] = p->l.t0;
    if (m->bounded)
        box_breaks(t, &count, &p->l, &m->bounds);
    for (i = 0; i < m->gaussian_count; i++) {
        passage g = pass(&m->gaussians[i], p->l.o, p->l.u);
        int k;
        for (k = -2; k <= 2; k++)
            add_break(t, &count, &p->l, g.m + 3 * k / g.a);
    }
    for (i = 0; i < m->grid_count; i++)
        box_breaks(t, &count, &p->l, &m->grids[i].box);
    t[count++] = p->l.t1;
    qsort(t, count, sizeof *t, compare);
    return count;
}

/* GSL must not abort where rounding keeps it from its tolerance. */
static void quiet(void) {
    gsl_set_error_handler_off();
}

/* cquad copes with the kinks of voxels, qag with the steep tails of Gaussians. */
static double probe_panel(probe *p, const quadrature *q, double t0, double t1) {
    double sum = 0, error;
    gsl_function f;
    f.function = probe_density;
    f.params = p;
    if (p->medium->grid_count > 0)
        gsl_integration_cquad(&f, t0, t1, 0, 1e-11, q->rough, &sum, &error, NULL);
    else
        gsl_integration_qag(&f, t0, t1, 0, 1e-11, INTERVALS, GSL_INTEG_GAUSS21, q->smooth, &sum,
                            &error);
    return sum;
}

double reference_optical_depth_adaptive(const scatter_medium *medium, scatter_vec3 p,
                                        scatter_vec3 q) {
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    size_t i, count, most = 4 + 5 * medium->gaussian_count + 2 * medium->grid_count;
    double *t = malloc(most * sizeof *t), sum = 0;
    quadrature space;
    probe data;
    pthread_once(&once, quiet);
    space.smooth = gsl_integration_workspace_alloc(INTERVALS);
    space.rough = gsl_integration_cquad_workspace_alloc(INTERVALS);
    data.medium = medium;
    data.l = segment(from(p), from(q));
    if (!t || !space.smooth || !space.rough)
        sum = NAN;
    count = sum == 0 && data.l.t1 > 0 ? probe_breaks(&data, t) : 0;
    for (i = 1; i < count; i++)
        sum += probe_panel(&data, &space, t[i - 1], t[i]);
    gsl_integration_workspace_free(space.smooth);
    gsl_integration_cquad_workspace_free(space.rough);
    free(t);
    return sum;
}

/* ---------------------------------------------------------------------- >>phase */

/* Draine 2003; alpha 0 is Henyey-Greenstein. 1 + g^2 - 2 g cos without cancellation near g = cos
   = 1. */
static double draine(double g, double alpha, double cosine) {
    double base = (1 - g) * (1 - g) + 2 * g * (1 - cosine);
    double norm = 4 * PI * (1 + alpha * (1 + 2 * g * g) / 3);
    return (1 - g * g) * (1 + alpha * cosine * cosine) / (norm * base * sqrt(base));
}

typedef struct droplets {
    double g_hg, g_draine, alpha, weight;
} droplets;

/* Jendersie and d'Eon 2023, "An approximate Mie scattering function for fog and cloud rendering";
   the diameter d in micrometres. */
static droplets droplets_small(double d) {
    droplets r;
    r.g_hg = 13.8 * d * d;
    r.g_draine = 1.1456 * d * sin(9.29044 * d);
    r.alpha = 250;
    r.weight = 0.252977 - 312.983 * pow(d, 4.3);
    return r;
}

static droplets droplets_middle(double d) {
    double s = log(d), wave = (s - 0.238604) * (s + 1.00667) / (0.507522 - 0.15677 * s);
    droplets r;
    r.g_hg = 0.862 - 0.143 * s * s;
    r.g_draine = 0.379685 * cos(1.19692 * cos(wave) + 1.37932 * s + 0.0625835) + 0.344213;
    r.alpha = 250;
    r.weight = 0.146209 * cos(3.38707 * s + 2.11193) + 0.316072 + 0.0778917 * s;
    return r;
}

static droplets droplets_large(double d) {
    double s = log(d);
    droplets r;
    r.g_hg = 0.0604931 * log(s) + 0.940256;
    r.g_draine = 0.500411 - 0.081287 / (-2 * s + tan(s) + 1.27551);
    r.alpha = 7.30354 * s + 6.31675;
    r.weight = 0.026914 * (s - cos(5.68947 * (log(s) - 0.0292149))) + 0.376475;
    return r;
}

static droplets droplets_fog(double d) {
    droplets r;
    r.g_hg = exp(-0.0990567 / (d - 1.67154));
    r.g_draine = exp(-2.20679 / (d + 3.91029) - 0.428934);
    r.alpha = exp(3.62489 - 8.29288 / (d + 5.52825));
    r.weight = exp(-0.599085 / (d - 0.641583) - 0.665888);
    return r;
}

static double droplets_phase(double d, double cosine) {
    droplets r = d <= 0.1  ? droplets_small(d)
                 : d < 1.5 ? droplets_middle(d)
                 : d < 5   ? droplets_large(d)
                           : droplets_fog(d);
    return (1 - r.weight) * draine(r.g_hg, 0, cosine) +
           r.weight * draine(r.g_draine, r.alpha, cosine);
}

double reference_phase(const scatter_phase *phase, double cos_theta) {
    switch (phase->kind) {
    case SCATTER_PHASE_HG:
        return draine((double)phase->g, 0, cos_theta);
    case SCATTER_PHASE_RAYLEIGH:
        return 3 / (16 * PI) * (1 + cos_theta * cos_theta);
    case SCATTER_PHASE_DRAINE:
        return draine((double)phase->g, (double)phase->alpha, cos_theta);
    case SCATTER_PHASE_DROPLETS:
        return droplets_phase((double)phase->diameter_um, cos_theta);
    case SCATTER_PHASE_ISOTROPIC:
        break;
    }
    return 1 / (4 * PI);
}

/* ---------------------------------------------------------------------- >>lights */

static double transmit(double extinction, double tau) {
    return extinction > 0 ? exp(-extinction * tau) : 1.0;
}

static double channel(scatter_vec3 v, int c) {
    return from(v).x[c];
}

/* A light as one ray sees it: t(u) = t0 + d sinh u for local lights, t = u for directional ones. */
typedef struct lamp {
    const scatter_light *light;
    vec position; /* of a local light */
    vec axis;     /* unit vector along light->direction */
    vec aside; /* unit vector from the ray to the light at right angles; 0 if it lies on the ray */
    double t0, h; /* local: closest point of the ray, and its distance */
    double slope; /* directional: how far along the ray the light comes from, per metre aside */
    double d;     /* 0 if directional */
} lamp;

static int is_local(const lamp *p) {
    return p->light->kind != SCATTER_LIGHT_DIRECTIONAL;
}

static lamp lamp_of(const scatter_light *light, const line *ray) {
    double radius = (double)light->radius;
    vec aside;
    lamp p;
    memset(&p, 0, sizeof p);
    p.light = light;
    p.position = from(light->position);
    if (light->kind != SCATTER_LIGHT_POINT)
        p.axis = unit(from(light->direction));
    aside = is_local(&p) ? minus(p.position, ray->o) : scaled(p.axis, -1.0);
    p.t0 = dot(aside, ray->u);
    aside = along(aside, ray->u, -p.t0);
    p.h = length(aside) > 1e-9 * fabs(p.t0) ? length(aside) : 0; /* or else only rounding */
    p.aside = scaled(aside, p.h > 0 ? 1 / p.h : 0);
    p.slope = p.t0 / p.h;
    p.d = is_local(&p) ? fmax(sqrt(p.h * p.h + radius * radius), 1e-9) : 0;
    return p;
}

static double lamp_t(const lamp *p, double u) {
    return p->d > 0 ? p->t0 + p->d * sinh(u) : u;
}

static double lamp_u(const lamp *p, double t) {
    return p->d > 0 ? asinh((t - p->t0) / p->d) : t;
}

static double spot(const scatter_light *light, double cosine) {
    double full = cos((double)light->inner), none = cos((double)light->outer), s;
    if (cosine >= full)
        return 1;
    s = cosine <= none ? 0 : (cosine - none) / (full - none);
    return s * s * (3 - 2 * s);
}

/* The way from x to the light; returns the irradiance at x without a medium, per intensity. */
static double lamp_at(const lamp *p, vec x, line *way) {
    double r2, radius = (double)p->light->radius;
    if (!is_local(p)) {
        *way = endless(x, scaled(p->axis, -1.0));
        return 1;
    }
    *way = segment(x, p->position);
    r2 = way->t1 * way->t1 + radius * radius;
    return (p->light->kind == SCATTER_LIGHT_SPOT ? spot(p->light, -dot(p->axis, way->u)) : 1) /
           r2;
}

static int lamp_visible(const scatter_scene *scene, const lamp *p, vec x) {
    vec target = is_local(p) ? p->position : along(x, p->axis, -1e6);
    return !scene->visible || scene->visible(scene->user, to_float(x), to_float(target));
}

/* Where the shadow of point b falls on the ray, and how much wider it is there; 0 if it falls
   elsewhere. */
static int shadow_of(const lamp *p, const line *ray, vec b, double *t, double *width) {
    vec d = minus(b, ray->o);
    double m = dot(d, ray->u), k = dot(d, p->aside), grow;
    if (!(p->h > 1e-6) || k <= 0 || (is_local(p) && k >= p->h * 0.999))
        return 0;
    if (!is_local(p)) {
        *t = m - k * p->slope;
        *width = 1 / p->h;
        return 1;
    }
    grow = p->h / (p->h - k);
    *t = p->t0 + (m - p->t0) * grow;
    *width = grow * sqrt(1 + (*t - p->t0) * (*t - p->t0) / (p->h * p->h));
    return 1;
}

/* ---------------------------------------------------------------------- >>path */

typedef struct memo {
    double u, k, tau;
} memo;

enum { MEMOS = 2048, PROBES = 2048, VOXEL_PLANES = 48, SECTORS = 32 };

typedef struct interval {
    double low, high, value, error;
} interval;

/* A Gaussian in the plane of ray and light: along the ray, aside, and out of the plane, m. */
typedef struct footprint {
    const scatter_gaussian *g;
    double m, k, off, reach;
} footprint;

/* All that one thread needs for rays through one scene. */
typedef struct path {
    const scatter_scene *scene;
    const scatter_medium *medium;
    interval *intervals; /* of adaptive quadrature */
    size_t interval_count, interval_limit;
    line l;             /* the ray inside the bounds */
    double begin, end;  /* the part of it with anything to integrate */
    double thin, dense; /* smallest and largest extinction of the channels that scatter */
    passage *passages;  /* Gaussians near the ray */
    size_t passage_count;
    footprint *footprints; /* Gaussians near the plane of the ray and the light at work */
    size_t footprint_count;
    scatter_gaussian *near; /* those that can shade a sector of the ray, sector after sector */
    size_t near_start[SECTORS + 1], sectors;
    double near_u0, near_u1; /* the range of u that is cut into sectors */
    walk *walks;             /* grids on the ray */
    size_t walk_count;
    double *crossing, *prefix; /* voxel planes on the ray, and the grids' depth up to them */
    size_t crossing_count;
    double *breaks, *points; /* of u */
    size_t break_count, break_limit;
    double narrowest;         /* half width of what the breaks are for, u */
    double edges[2 * PROBES]; /* of shadows, u */
    size_t edge_count;
    memo memos[MEMOS];
} path;

static void path_free(path *p) {
    if (p) {
        free(p->intervals);
        free(p->passages);
        free(p->footprints);
        free(p->near);
        free(p->walks);
        free(p->crossing);
        free(p->prefix);
        free(p->breaks);
        free(p->points);
        free(p);
    }
}

/* Room for the worst ray; NULL if out of memory. */
static path *path_create(const scatter_scene *scene) {
    const scatter_medium *m = &scene->medium;
    size_t i, planes = 1;
    path *p = calloc(1, sizeof *p);
    if (!p)
        return NULL;
    for (i = 0; i < m->grid_count; i++)
        planes += 2 + (size_t)m->grids[i].nx + (size_t)m->grids[i].ny + (size_t)m->grids[i].nz;
    p->scene = scene;
    p->medium = m;
    p->sectors = m->gaussian_count < 64 ? 1 : SECTORS;
    p->break_limit = 1000 + planes + 48 * (m->gaussian_count + m->height_count + m->grid_count);
    p->interval_limit = p->break_limit + INTERVALS;
    p->intervals = malloc(p->interval_limit * sizeof *p->intervals);
    p->passages = malloc((m->gaussian_count + 1) * sizeof *p->passages);
    p->footprints = malloc((m->gaussian_count + 1) * sizeof *p->footprints);
    p->near = malloc((p->sectors * m->gaussian_count + 1) * sizeof *p->near);
    p->walks = malloc((m->grid_count + 1) * sizeof *p->walks);
    p->crossing = malloc(planes * sizeof *p->crossing);
    p->prefix = malloc(planes * sizeof *p->prefix);
    p->breaks = malloc(p->break_limit * sizeof *p->breaks);
    p->points = malloc((p->break_limit + 2) * sizeof *p->points);
    if (!p->intervals || !p->passages || !p->footprints || !p->near || !p->walks ||
        !p->crossing || !p->prefix || !p->breaks || !p->points) {
        path_free(p);
        return NULL;
    }
    return p;
}

static void path_extend(path *p, double t0, double t1) {
    p->begin = fmin(p->begin, fmax(t0, p->l.t0));
    p->end = fmax(p->end, fmin(t1, p->l.t1));
}

static void path_gaussians(path *p) {
    size_t i;
    p->passage_count = 0;
    for (i = 0; i < p->medium->gaussian_count; i++) {
        passage g = pass(&p->medium->gaussians[i], p->l.o, p->l.u);
        double reach = g.miss < NEGLIGIBLE ? sqrt(NEGLIGIBLE - g.miss) / g.a : 0;
        if (reach > 0 && g.m + reach > p->l.t0 && g.m - reach < p->l.t1) {
            p->passages[p->passage_count++] = g;
            path_extend(p, g.m - reach, g.m + reach);
        }
    }
}

/* Depth of all grids between neighbouring crossings or less. */
static double path_piece(const path *p, double t0, double t1) {
    double sum = 0;
    size_t i;
    for (i = 0; i < p->walk_count; i++) {
        const walk *w = &p->walks[i];
        double a = fmax(t0, w->l.t0), b = fmin(t1, w->l.t1);
        sum += a < b ? walk_depth(w, a, b) : 0;
    }
    return sum;
}

static void path_grids(path *p) {
    size_t i;
    double t;
    p->walk_count = p->crossing_count = 0;
    for (i = 0; i < p->medium->grid_count; i++) {
        walk *w = &p->walks[p->walk_count];
        if (walk_begin(w, &p->medium->grids[i], &p->l)) {
            p->walk_count++;
            path_extend(p, w->l.t0, w->l.t1);
            for (t = w->l.t0; t < w->l.t1; t = walk_next(w, t))
                p->crossing[p->crossing_count++] = t;
            p->crossing[p->crossing_count++] = w->l.t1;
        }
    }
    qsort(p->crossing, p->crossing_count, sizeof *p->crossing, compare);
    for (i = 0; i < p->crossing_count; i++) {
        p->prefix[i] = i == 0 ? 0 : p->prefix[i - 1];
        p->prefix[i] += i == 0 ? 0 : path_piece(p, p->crossing[i - 1], p->crossing[i]);
    }
}

static double path_grid_depth(const path *p, double t) {
    size_t low = 0, high = p->crossing_count;
    if (high == 0 || t <= p->crossing[0])
        return 0;
    while (high - low > 1) {
        size_t middle = low + (high - low) / 2;
        if (p->crossing[middle] <= t)
            low = middle;
        else
            high = middle;
    }
    return p->prefix[low] + path_piece(p, p->crossing[low], t);
}

static double path_fog_depth(const path *p, double t) {
    line l = p->l;
    l.t1 = t;
    return fog_depth(p->medium, &l);
}

static double path_depth(const path *p, double t) {
    double sum = path_fog_depth(p, t) + path_grid_depth(p, t);
    size_t i;
    for (i = 0; i < p->passage_count; i++)
        sum += passage_depth(&p->passages[i], p->l.t0, t);
    return sum;
}

static double path_density(const path *p, double t) {
    const scatter_medium *m = p->medium;
    double sum = (double)m->constant, s;
    size_t i;
    for (i = 0; i < m->height_count; i++)
        sum += height_density(&m->heights[i], p->l.o.x[1] + t * p->l.u.x[1]);
    for (i = 0; i < p->passage_count; i++) {
        s = p->passages[i].a * (t - p->passages[i].m);
        sum += p->passages[i].peak * exp(-s * s);
    }
    for (i = 0; i < p->walk_count; i++) {
        const walk *w = &p->walks[i];
        if (t >= w->l.t0 && t <= w->l.t1) {
            vec q = walk_point(w, t);
            cell c = cell_at(w->grid, &w->r, q);
            sum += grid_scale(w->grid) * cell_value(&c, q);
        }
    }
    return sum;
}

static int has_fog(const scatter_medium *m) {
    size_t i;
    int any = m->constant > 0;
    for (i = 0; i < m->height_count; i++)
        any = any || m->heights[i].density > 0;
    return any;
}

/* Where the depth of the fog alone reaches tau, at most at `high`. */
static double fog_reaches(const path *p, double tau, double high) {
    double low = p->l.t0;
    int i;
    if (path_fog_depth(p, high) <= tau)
        return high;
    for (i = 0; i < 60; i++) {
        double middle = 0.5 * (low + high);
        if (path_fog_depth(p, middle) < tau)
            low = middle;
        else
            high = middle;
    }
    return high;
}

/* Above this nothing is left of height fog: exp(-32) = 1e-14. */
static double fog_top(const path *p) {
    const scatter_medium *m = p->medium;
    double dy = p->l.u.x[1], top = p->l.t0;
    size_t i;
    if (m->constant > 0 || dy <= 0)
        return INFINITY;
    for (i = 0; i < m->height_count; i++)
        top = fmax(top, p->l.t0 + 32 * (double)m->heights[i].scale / dy);
    return top;
}

static void path_extinctions(path *p) {
    int c;
    p->thin = INFINITY;
    p->dense = 0;
    for (c = 0; c < 3; c++) {
        double e = channel(p->medium->extinction, c);
        if (e > 0 && channel(p->medium->albedo, c) > 0) {
            p->thin = fmin(p->thin, e);
            p->dense = fmax(p->dense, e);
        }
    }
}

/* 0 if nothing on the ray scatters. */
static int path_begin(path *p, const line *ray) {
    p->l = *ray;
    path_extinctions(p);
    if (p->dense == 0 || (p->medium->bounded && !clip(&p->l, &p->medium->bounds)))
        return 0;
    p->begin = INFINITY;
    p->end = -INFINITY;
    path_gaussians(p);
    path_grids(p);
    if (has_fog(p->medium)) {
        path_extend(p, p->l.t0, fmin(p->l.t0 + FAR_END, fog_top(p)));
        p->end = fog_reaches(p, NEGLIGIBLE / p->thin, p->end);
    }
    return p->begin < p->end;
}

/* ---------------------------------------------------------------------- >>source on the path */

static footprint footprint_of(const path *p, const lamp *light, const scatter_gaussian *g) {
    vec d = minus(from(g->center), p->l.o);
    footprint f;
    f.g = g;
    f.m = dot(d, p->l.u);
    f.k = dot(d, light->aside);
    f.off = length(along(along(d, p->l.u, -f.m), light->aside, -f.k));
    f.reach = sqrt(NEGLIGIBLE) / (double)g->a;
    return f;
}

/* Signed distance of a footprint to the line of light that meets the ray at u. */
static double beyond(const lamp *light, const footprint *f, double u) {
    double t = lamp_t(light, u), dx = is_local(light) ? light->t0 - t : light->t0, dy = light->h;
    double s = sqrt(dx * dx + dy * dy);
    return s > 0 ? ((f->m - t) * dy - f->k * dx) / s : 0;
}

static void find_footprints(path *p, const lamp *light) {
    size_t i;
    p->footprint_count = 0;
    for (i = 0; i < p->medium->gaussian_count; i++) {
        footprint f = footprint_of(p, light, &p->medium->gaussians[i]);
        if (f.off < f.reach && f.k > -f.reach)
            p->footprints[p->footprint_count++] = f;
    }
}

/* Sorts the Gaussians that can shade the ray into sectors of u. */
static void select_near(path *p, const lamp *light) {
    size_t i, k, count = 0;
    p->near_u0 = lamp_u(light, p->begin);
    p->near_u1 = lamp_u(light, p->end);
    find_footprints(p, light);
    for (k = 0; k < p->sectors; k++) {
        double step = (p->near_u1 - p->near_u0) / (double)p->sectors;
        double u = p->near_u0 + step * (double)k;
        p->near_start[k] = count;
        for (i = 0; i < p->footprint_count; i++) {
            const footprint *f = &p->footprints[i];
            if (beyond(light, f, u) > -f->reach && beyond(light, f, u + step) < f->reach)
                p->near[count++] = *f->g;
        }
    }
    p->near_start[p->sectors] = count;
}

static size_t sector_of(const path *p, double u) {
    double s = (u - p->near_u0) / (p->near_u1 - p->near_u0) * (double)p->sectors;
    return (size_t)clamp(s, 0.0, (double)p->sectors - 1);
}

/* depth() without the Gaussians that are far from the line; u says where on the ray it starts. */
static double near_depth(const path *p, double u, line l) {
    const scatter_medium *m = p->medium;
    size_t i, sector = sector_of(p, u);
    double sum;
    if ((m->bounded && !clip(&l, &m->bounds)) || !(l.t0 < l.t1))
        return 0;
    sum = fog_depth(m, &l);
    for (i = p->near_start[sector]; i < p->near_start[sector + 1]; i++) {
        passage g = approach(&p->near[i], l.o, l.u);
        double reach = sqrt(NEGLIGIBLE) / g.a;
        if (g.miss < NEGLIGIBLE && l.t0 < g.m + reach && l.t1 > g.m - reach) {
            g.peak = (double)p->near[i].c * exp(-g.miss);
            sum += passage_depth(&g, l.t0, l.t1);
        }
    }
    for (i = 0; i < m->grid_count; i++)
        sum += grid_depth(&m->grids[i], &l);
    return sum;
}

/* Of the light scattered at u towards the eye: colourless factor k (density, irradiance, phase
   function and dt/du) and optical depth tau from the light over x to the eye. */
static void source_at(const path *p, const lamp *light, double u, double *k, double *tau) {
    double t = clamp(lamp_t(light, u), p->l.t0, p->l.t1), eye = path_depth(p, t);
    vec x = along(p->l.o, p->l.u, t);
    line way;
    *tau = eye;
    *k = path_density(p, t) * lamp_at(light, x, &way) * (light->d > 0 ? light->d * cosh(u) : 1);
    if (p->thin * eye > 2 * NEGLIGIBLE || *k == 0) {
        *k = 0;
        return;
    }
    *tau += near_depth(p, u, way);
    *k *= reference_phase(&p->medium->phase, dot(way.u, p->l.u));
}

typedef struct integrand {
    path *p;
    const lamp *light;
    double extinction;
} integrand;

/* Colours mostly ask for the same points one after the other. */
static double integrand_at(double u, void *data) {
    integrand *f = data;
    uint64_t bits;
    memo *m;
    memcpy(&bits, &u, sizeof bits);
    m = &f->p->memos[(bits * 0x9E3779B97F4A7C15u) >> 53];
    if (!(m->u == u)) {
        m->u = u;
        source_at(f->p, f->light, u, &m->k, &m->tau);
    }
    return m->k == 0 ? 0 : m->k * transmit(f->extinction, m->tau);
}

static void forget(path *p) {
    size_t i;
    for (i = 0; i < MEMOS; i++)
        p->memos[i].u = NAN;
}

/* ---------------------------------------------------------------------- >>breaks */

static int has_voxels(const path *p) {
    return p->crossing_count > VOXEL_PLANES;
}

static void break_at(path *p, const lamp *light, double t) {
    if (t > p->begin && t < p->end && p->break_count < p->break_limit)
        p->breaks[p->break_count++] = lamp_u(light, t);
}

/* Something of half width w around t, if quadrature of the whole range could overlook it. */
static void break_around(path *p, const lamp *light, double t, double w) {
    double range = lamp_u(light, p->end) - lamp_u(light, p->begin);
    double wide = lamp_u(light, t + w) - lamp_u(light, t - w);
    int k, steps = has_voxels(p) ? 10 : 1;
    if (wide < range / (has_voxels(p) ? 2 : 4)) {
        p->narrowest = fmin(p->narrowest, wide / 2);
        for (k = -steps; k <= steps; k++)
            break_at(p, light, t + w * k / steps);
    }
}

static void break_gaussians(path *p, const lamp *light) {
    size_t i;
    double t, width;
    p->narrowest = INFINITY;
    for (i = 0; i < p->passage_count; i++)
        break_around(p, light, p->passages[i].m, sqrt(NEGLIGIBLE) / p->passages[i].a);
    for (i = 0; i < p->footprint_count; i++) {
        const scatter_gaussian *g = p->footprints[i].g;
        if (p->dense * (double)g->c / (double)g->a > 1e-9 &&
            shadow_of(light, &p->l, from(g->center), &t, &width))
            break_around(p, light, t, sqrt(NEGLIGIBLE) / (double)g->a * width);
    }
}

/* Edges of the box bend the depth from the light where the plane of ray and light cuts them. */
static void break_edges(path *p, const lamp *light, const scatter_box *box) {
    vec corner[2], normal = cross(p->l.u, light->aside), b, d;
    double s, t, width;
    int axis, k;
    corner[0] = from(box->min);
    corner[1] = from(box->max);
    for (axis = 0; axis < 3; axis++) {
        for (k = 0; k < 4 && normal.x[axis] != 0; k++) {
            b = corner[0];
            b.x[(axis + 1) % 3] = corner[k & 1].x[(axis + 1) % 3];
            b.x[(axis + 2) % 3] = corner[k >> 1].x[(axis + 2) % 3];
            d = minus(p->l.o, b);
            s = dot(normal, d) / normal.x[axis];
            b.x[axis] += s;
            if (s >= 0 && b.x[axis] <= corner[1].x[axis] &&
                shadow_of(light, &p->l, b, &t, &width))
                break_at(p, light, t);
        }
    }
}

static void break_boxes(path *p, const lamp *light) {
    size_t i;
    if (p->medium->bounded)
        break_edges(p, light, &p->medium->bounds);
    for (i = 0; i < p->medium->grid_count; i++)
        break_edges(p, light, &p->medium->grids[i].box);
    for (i = 0; i < p->crossing_count; i++)
        break_at(p, light, p->crossing[i]);
}

/* Layers: where fog closes the view, and where height fog begins to matter. */
static void break_fog(path *p, const lamp *light) {
    static const double level[5] = {1e-4, 1e-2, 0.3, 2, 8};
    const scatter_medium *m = p->medium;
    double dy = p->l.u.x[1];
    size_t i;
    int k;
    for (k = 0; k < 5 && has_fog(m); k++) {
        break_at(p, light, fog_reaches(p, level[k] / p->dense, p->end));
        break_at(p, light, fog_reaches(p, level[k] / p->thin, p->end));
    }
    for (i = 0; i < m->height_count && dy != 0; i++) {
        double s = (double)m->heights[i].scale / dy, bottom = dy > 0 ? p->begin : p->end;
        break_at(p, light, bottom + s);
        break_at(p, light, bottom + 4 * s);
        break_at(p, light, bottom + 12 * s);
        break_at(p, light, bottom + 32 * s);
    }
}

/* Where the ray meets the cone of that half-angle. */
static void break_cone(path *p, const lamp *light, double angle) {
    vec w = minus(p->l.o, light->position);
    double c2 = cos(angle) * cos(angle), a = dot(light->axis, p->l.u), b = dot(light->axis, w);
    double q2 = a * a - c2, q1 = a * b - c2 * dot(p->l.u, w), q0 = b * b - c2 * dot(w, w);
    double root = q1 * q1 - q2 * q0;
    if (root >= 0 && q2 != 0) {
        break_at(p, light, (-q1 - sqrt(root)) / q2);
        break_at(p, light, (-q1 + sqrt(root)) / q2);
    }
}

/* Sorts the breaks and drops those that come too close to the one before. */
static void thin_breaks(path *p, double smallest) {
    size_t i, kept = 1;
    qsort(p->breaks, p->break_count, sizeof *p->breaks, compare);
    for (i = kept; i < p->break_count; i++)
        if (p->breaks[i] - p->breaks[kept - 1] > smallest)
            p->breaks[kept++] = p->breaks[i];
    p->break_count = p->break_count > kept ? kept : p->break_count;
}

/* Fills p->breaks from the begin to the end of the path, ascending in u. */
static void find_breaks(path *p, const lamp *light) {
    double low = lamp_u(light, p->begin), high = lamp_u(light, p->end);
    int i, parts = has_voxels(p) ? 64 : 4;
    p->break_count = 0;
    break_gaussians(p, light);
    if (p->break_count > 64 && !has_voxels(p)) /* many: as fine as the narrowest is enough */
        thin_breaks(p, fmax(0.7 * p->narrowest, 1e-3 * (high - low)));
    for (i = 0; i <= parts; i++)
        p->breaks[p->break_count++] = low + (high - low) * i / parts;
    break_boxes(p, light);
    break_fog(p, light);
    if (is_local(light))
        break_at(p, light, light->t0);
    if (light->light->kind == SCATTER_LIGHT_SPOT) {
        break_cone(p, light, (double)light->light->inner);
        break_cone(p, light, (double)light->light->outer);
    }
    thin_breaks(p, 1e-13 * (high - low));
}

static int visible_at(const path *p, const lamp *light, double u) {
    return lamp_visible(p->scene, light, along(p->l.o, p->l.u, lamp_t(light, u)));
}

/* Where between low and high the visibility changes. */
static double find_edge(const path *p, const lamp *light, double low, double high) {
    int i, seen = visible_at(p, light, low);
    for (i = 0; i < 40; i++) {
        double middle = 0.5 * (low + high);
        if (visible_at(p, light, middle) == seen)
            low = middle;
        else
            high = middle;
    }
    return 0.5 * (low + high);
}

/* Collects the places where the visibility of the light changes; returns the visibility at the
   start. */
static int find_edges(path *p, const lamp *light) {
    size_t k, per = PROBES / (p->break_count - 1);
    double before = p->breaks[0];
    int start = visible_at(p, light, before), seen = start;
    per = per < 2 ? 2 : per;
    p->edge_count = 0;
    for (k = 1; k <= per * (p->break_count - 1) && p->scene->visible; k++) {
        size_t panel = (k - 1) / per;
        double step = (p->breaks[panel + 1] - p->breaks[panel]) / (double)per;
        double u = p->breaks[panel] + step * ((double)((k - 1) % per) + 0.5);
        int now = visible_at(p, light, u);
        if (now != seen && p->edge_count < 2 * PROBES)
            p->edges[p->edge_count++] = find_edge(p, light, before, u);
        seen = now;
        before = u;
    }
    return start;
}

/* ---------------------------------------------------------------------- >>ray */

/* Breaks from low to high, both included, into p->points. */
static size_t run_points(path *p, double low, double high) {
    size_t i, count = 0;
    p->points[count++] = low;
    for (i = 0; i < p->break_count; i++)
        if (p->breaks[i] > low && p->breaks[i] < high)
            p->points[count++] = p->breaks[i];
    p->points[count++] = high;
    return count;
}

static int scatters(const path *p, int c) {
    return channel(p->medium->extinction, c) > 0 && channel(p->medium->albedo, c) > 0;
}

/* Gauss-Kronrod on one interval. */
static interval estimate(gsl_function *f, double low, double high) {
    double absolute, deviation;
    interval i;
    i.low = low;
    i.high = high;
    gsl_integration_qk21(f, low, high, &i.value, &i.error, &absolute, &deviation);
    return i;
}

/* Halves the worst interval; one that cannot be halved any more is taken as it is. */
static void refine(path *p, gsl_function *f) {
    size_t i, worst = 0;
    interval *w;
    double middle;
    for (i = 1; i < p->interval_count; i++)
        worst = p->intervals[i].error > p->intervals[worst].error ? i : worst;
    w = &p->intervals[worst];
    middle = 0.5 * (w->low + w->high);
    if (middle - w->low < 1e-13 * (fabs(w->low) + fabs(w->high))) {
        w->error = 0;
        return;
    }
    p->intervals[p->interval_count++] = estimate(f, middle, w->high);
    *w = estimate(f, w->low, middle);
}

/* The integral of f over p->points to a relative 1e-8. Not gsl_integration_qagp, whose
   extrapolation can settle on a false value where features of very different widths meet. */
static double adaptive(path *p, gsl_function *f, size_t count) {
    double value, error;
    size_t i;
    for (i = 1; i < count; i++)
        p->intervals[i - 1] = estimate(f, p->points[i - 1], p->points[i]);
    p->interval_count = count - 1;
    for (;;) {
        value = error = 0;
        for (i = 0; i < p->interval_count; i++) {
            value += p->intervals[i].value;
            error += p->intervals[i].error;
        }
        if (!(error > 1e-8 * value) || p->interval_count == p->interval_limit)
            return value;
        refine(p, f);
    }
}

static void run_adaptive(path *p, const lamp *light, size_t count, double sum[3]) {
    double value[3] = {0, 0, 0};
    integrand data;
    gsl_function f;
    int c, same;
    data.p = p;
    data.light = light;
    f.function = integrand_at;
    f.params = &data;
    for (c = 0; c < 3; c++) {
        data.extinction = channel(p->medium->extinction, c);
        for (same = 0; channel(p->medium->extinction, same) != data.extinction; same++)
            ;
        if (same < c && scatters(p, same))
            value[c] = value[same];
        else if (scatters(p, c))
            value[c] = adaptive(p, &f, count);
        sum[c] += value[c];
    }
}

/* Four Gauss-Legendre points between u0 and u1. */
static void panel(const path *p, const lamp *light, double u0, double u1, double sum[3]) {
    static const double node[4] = {-0.8611363115940526, -0.3399810435848563, 0.3399810435848563,
                                   0.8611363115940526};
    static const double weight[4] = {0.3478548451374538, 0.6521451548625461, 0.6521451548625461,
                                     0.3478548451374538};
    double m = 0.5 * (u1 + u0), h = 0.5 * (u1 - u0), k, tau;
    int j, c;
    for (j = 0; j < 4; j++) {
        source_at(p, light, m + h * node[j], &k, &tau);
        for (c = 0; c < 3 && k > 0; c++)
            sum[c] += h * weight[j] * k * transmit(channel(p->medium->extinction, c), tau);
    }
}

/* Panels from one crossing to the next, finer where a cell is opaque. */
static void run_voxels(path *p, const lamp *light, size_t count, double sum[3]) {
    double before = path_depth(p, lamp_t(light, p->points[0])), after;
    size_t i;
    int k, parts;
    for (i = 1; i < count && p->thin * before < NEGLIGIBLE; i++, before = after) {
        double u = p->points[i - 1], step = p->points[i] - u;
        after = path_depth(p, lamp_t(light, p->points[i]));
        parts = 1 + (int)fmin(32.0, 4 * p->dense * (after - before));
        for (k = 0; k < parts; k++)
            panel(p, light, u + step * k / parts, u + step * (k + 1) / parts, sum);
    }
}

static void run(path *p, const lamp *light, double low, double high, double sum[3]) {
    size_t count;
    if (low < high) {
        count = run_points(p, low, high);
        if (has_voxels(p))
            run_voxels(p, light, count, sum);
        else
            run_adaptive(p, light, count, sum);
    }
}

static double scattering(const path *p, const lamp *light, int c) {
    return channel(p->medium->extinction, c) * channel(p->medium->albedo, c) *
           channel(light->light->intensity, c);
}

/* Adds the light of one lamp that the medium scatters to the origin. */
static void add_scattered(path *p, const scatter_light *light, double rgb[3]) {
    lamp l = lamp_of(light, &p->l);
    double start, sum[3] = {0, 0, 0};
    int c, seen;
    size_t i;
    forget(p);
    select_near(p, &l);
    find_breaks(p, &l);
    if (p->break_count < 2) /* so short that rounding leaves nothing of it */
        return;
    seen = find_edges(p, &l);
    start = p->breaks[0];
    for (i = 0; i <= p->edge_count; i++) {
        double stop = i < p->edge_count ? p->edges[i] : p->breaks[p->break_count - 1];
        if (seen)
            run(p, &l, start, stop, sum);
        start = stop;
        seen = !seen;
    }
    for (c = 0; c < 3; c++)
        rgb[c] += sum[c] * scattering(p, &l, c);
}

/* The integral of D exp(-sigma tau) over the whole ray is (1 - exp(-sigma tau)) / sigma. */
static double emitted(const scatter_medium *m, int c, double tau) {
    double e = channel(m->emission, c), extinction = channel(m->extinction, c);
    return e == 0 ? 0 : extinction > 0 ? e * -expm1(-extinction * tau) / extinction : e * tau;
}

/* ---------------------------------------------------------------------- >>surface */

/* Lambert plus Phong, 1/sr. */
static double reflectance(const scatter_surface *s, vec to_eye, vec to_light, int c) {
    vec n = from(s->normal), mirror = minus(scaled(n, 2 * dot(n, to_light)), to_light);
    double shininess = (double)s->shininess, cosine = dot(mirror, to_eye);
    double phong = cosine > 0 ? (shininess + 2) / (2 * PI) * pow(cosine, shininess) : 0;
    return channel(s->albedo, c) / PI + channel(s->specular, c) * phong;
}

static void shade(const scatter_scene *scene, const scatter_surface *s, vec x, vec to_eye,
                  double rgb[3]) {
    size_t i;
    int c;
    rgb[0] = rgb[1] = rgb[2] = 0;
    for (i = 0; i < scene->light_count; i++) {
        line none = endless(x, to_eye), way;
        lamp l = lamp_of(&scene->lights[i], &none);
        double e = lamp_at(&l, x, &way) * dot(from(s->normal), way.u), tau;
        if (e > 0 && lamp_visible(scene, &l, x)) {
            tau = depth(&scene->medium, way);
            for (c = 0; c < 3; c++) {
                rgb[c] += e * channel(l.light->intensity, c) * reflectance(s, to_eye, way.u, c) *
                          transmit(channel(scene->medium.extinction, c), tau);
            }
        }
    }
}

/* Ends the ray at a surface and says what leaves it, or says the background. */
static void find_surface(const scatter_scene *scene, line *ray, double rgb[3]) {
    scatter_surface hit;
    int c;
    memset(&hit, 0, sizeof hit);
    if (scene->surface && scene->surface(scene->user, to_float(ray->o), to_float(ray->u), &hit)) {
        ray->t1 = (double)hit.distance;
        shade(scene, &hit, along(ray->o, ray->u, ray->t1), scaled(ray->u, -1.0), rgb);
        return;
    }
    for (c = 0; c < 3; c++)
        rgb[c] = channel(scene->background, c);
}

static void radiance(path *p, line ray, double rgb[3], double transmittance[3],
                     double surface[3]) {
    const scatter_scene *scene = p->scene;
    double tau;
    size_t i;
    int c;
    find_surface(scene, &ray, surface);
    tau = depth(&scene->medium, ray);
    for (c = 0; c < 3; c++) {
        transmittance[c] = transmit(channel(scene->medium.extinction, c), tau);
        rgb[c] = emitted(&scene->medium, c, tau);
    }
    if (scene->light_count > 0 && path_begin(p, &ray))
        for (i = 0; i < scene->light_count; i++)
            add_scattered(p, &scene->lights[i], rgb);
}

int reference_radiance(const scatter_scene *scene, const scatter_ray *ray, double rgb_medium[3],
                       double transmittance[3], double surface[3]) {
    double value[3][3];
    path *p = path_create(scene);
    if (!p)
        return -1;
    radiance(p, endless(from(ray->origin), unit(from(ray->direction))), value[0], value[1],
             value[2]);
    path_free(p);
    if (rgb_medium)
        memcpy(rgb_medium, value[0], sizeof value[0]);
    if (transmittance)
        memcpy(transmittance, value[1], sizeof value[1]);
    if (surface)
        memcpy(surface, value[2], sizeof value[2]);
    return 0;
}

/* ---------------------------------------------------------------------- >>image */

typedef struct image {
    const scatter_scene *scene;
    const scatter_view *view;
    int width, height, next_row, failed;
    float *rgb;
    pthread_mutex_t lock;
} image;

static line pixel_ray(const image *im, int x, int y) {
    const scatter_view *v = im->view;
    double sx = (x + 0.5) / im->width, sy = (y + 0.5) / im->height;
    vec o = along(along(from(v->origin), from(v->origin_dx), sx), from(v->origin_dy), sy);
    vec d =
        along(along(from(v->direction), from(v->direction_dx), sx), from(v->direction_dy), sy);
    return endless(o, unit(d));
}

static void image_row(const image *im, path *p, int y) {
    double rgb[3], transmittance[3], surface[3];
    int x, c;
    for (x = 0; x < im->width; x++) {
        float *out = im->rgb + 3 * ((size_t)y * (size_t)im->width + (size_t)x);
        radiance(p, pixel_ray(im, x, y), rgb, transmittance, surface);
        for (c = 0; c < 3; c++)
            out[c] = (float)(rgb[c] + transmittance[c] * surface[c]);
    }
}

static int take_row(image *im, int failed) {
    int row;
    pthread_mutex_lock(&im->lock);
    im->failed = im->failed || failed;
    row = im->next_row++;
    pthread_mutex_unlock(&im->lock);
    return row;
}

static void *image_worker(void *data) {
    image *im = data;
    path *p = path_create(im->scene);
    int y;
    for (y = take_row(im, !p); p && y < im->height; y = take_row(im, 0))
        image_row(im, p, y);
    path_free(p);
    return NULL;
}

int reference_image(const scatter_scene *scene, const scatter_view *view, int width, int height,
                    float *rgb, int threads) {
    enum { MOST = 64 };
    pthread_t helper[MOST];
    image im;
    int i, count = 0;
    memset(&im, 0, sizeof im);
    im.scene = scene;
    im.view = view;
    im.width = width;
    im.height = height;
    im.rgb = rgb;
    pthread_mutex_init(&im.lock, NULL);
    while (count < threads - 1 && count < MOST &&
           !pthread_create(&helper[count], NULL, image_worker, &im))
        count++;
    image_worker(&im);
    for (i = 0; i < count; i++)
        pthread_join(helper[i], NULL);
    pthread_mutex_destroy(&im.lock);
    return im.failed ? -1 : 0;
}
