/* specialised.c - compiles the copy of the library that knows its one class of scenes (see
   specialise.sh) beside the whole one. MIT licence. */
#define SCATTER_STATIC
#define SCATTER_IMPLEMENTATION
#include "specialised_scatter.h" /* written by specialise.sh */

#include "specialised_calls.h" /* finds SCATTER_H defined */

const specialised_calls specialised = {scatter_create, scatter_destroy, scatter_update,
                                       scatter_render};
