#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif
#define SCATTER_IMPLEMENTATION
#include "../scatter_gl.h"
#include "gl_shadow.h"
int main(int argc,char**argv){
  gl_scene s; gl_truth t; gl_shadow b;
  const char*path=argc>1?argv[1]:"bench/eight.scatter";
  gl_scene_open(&s,path,256,256);
  printf("%s | %s | clock %d\n",the_gl()->renderer,the_gl()->version,the_gl()->clock);
  gl_truth_open(&t,&s,256,64);
  static const int nodes[]={4,10,16};
  for(int i=0;i<3;i++){ setting w=setting_of(SCATTER_DEPTH_CLOSED_VOLUME,SCATTER_RAY_QUADRATURE,nodes[i],64);
    gl_measure(&s,&w,3); gl_compare(&s,&t,&w);
    printf("nodes %d update %.3f draw %.2f ms (%.2f us/px) rmse %.4f%%\n",nodes[i],timing_median(&w.setup),timing_median(&w.rays),timing_median(&w.rays)*1e3/65536,100*w.rmse);}
  gl_shadow_open(&b,&s,256);
  for(int n=16;n<=256&&argc<3;n*=2)for(int m=8;m<=128;m*=2){gl_shadow_way w={n,m,0,{{0},0}};gl_shadow_try(&b,&w,&t);
    printf("shadow %d %d: %.1f ms %.3f%%\n",n,m,timing_median(&w.ms),100*w.rmse);}
  gl_shadow_close(&b);gl_truth_close(&t);gl_scene_close(&s);
}
