/* reference.h - what scatter.h should answer, computed slowly in double precision. MIT licence.

   Written from the equations, not from scatter.h: it takes the types and their meaning from there
   and calls none of its functions. Density and optical depth are exact to rounding. The integral
   along a ray is taken by GSL's adaptive quadrature to a relative 1e-7, except for rays that
   cross many voxels, which get Gauss-Legendre points in every voxel (see reference.c and
   test_reference.c). Link with -lgsl -lgslcblas -lm -pthread. All functions may be called from
   several threads. */
#ifndef REFERENCE_H
#define REFERENCE_H

#include "../scatter.h"

/* Density D at x, 1. */
double reference_density(const scatter_medium *medium, scatter_vec3 x);

/* Optical depth between p and q, m (times density): closed form, voxels cell by cell. */
double reference_optical_depth(const scatter_medium *medium, scatter_vec3 p, scatter_vec3 q);

/* The same by adaptive quadrature of reference_density to about 1e-9 relative: slow, a check of
   the other. */
double reference_optical_depth_adaptive(const scatter_medium *medium, scatter_vec3 p,
                                        scatter_vec3 q);

/* Optical depth between a source (a point, or infinitely far away) and x, m (times density).
   INFINITY where endless fog lies between. */
double reference_source_depth(const scatter_medium *medium, const scatter_source *source,
                              scatter_vec3 x);

/* Phase function, 1/sr. */
double reference_phase(const scatter_phase *phase, double cos_theta);

/* One ray, RGB: radiance scattered and emitted by the medium towards the origin; transmittance of
   the medium up to the surface or the far end; radiance that leaves the surface (scene->surface),
   or the background. Seen: rgb_medium + transmittance * surface. Any of the three may be NULL. 0,
   or -1 if out of memory. */
int reference_radiance(const scatter_scene *scene, const scatter_ray *ray, double rgb_medium[3],
                       double transmittance[3], double surface[3]);

/* The image that scatter_render makes of the scene: rgb takes width*height*3 floats. `threads`
   >= 1. 0, or -1 if out of memory. */
int reference_image(const scatter_scene *scene, const scatter_view *view, int width, int height,
                    float *rgb, int threads);

#endif
