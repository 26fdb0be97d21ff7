/* gl_functions.h - the OpenGL functions that the tests of scatter_gl.h call themselves, by pointer:
   nothing is linked. Functions later than the context's version may be NULL, or pointers that must
   not be called. */
#ifndef GL_FUNCTIONS_H
#define GL_FUNCTIONS_H

#include <string.h>

#include <GL/glcorearb.h>

/* clang-format off */
#define GL_FUNCTIONS(F) \
    F(ACTIVETEXTURE, ActiveTexture) F(ATTACHSHADER, AttachShader) F(BEGINQUERY, BeginQuery) \
    F(BEGINTRANSFORMFEEDBACK, BeginTransformFeedback) F(BINDBUFFER, BindBuffer) \
    F(BINDBUFFERBASE, BindBufferBase) F(BINDBUFFERRANGE, BindBufferRange) \
    F(BINDFRAMEBUFFER, BindFramebuffer) F(BINDIMAGETEXTURE, BindImageTexture) \
    F(BINDPROGRAMPIPELINE, BindProgramPipeline) F(BINDRENDERBUFFER, BindRenderbuffer) \
    F(BINDSAMPLER, BindSampler) F(BINDTEXTURE, BindTexture) \
    F(BINDTRANSFORMFEEDBACK, BindTransformFeedback) F(BINDVERTEXARRAY, BindVertexArray) \
    F(BLENDCOLOR, BlendColor) F(BLENDEQUATIONSEPARATE, BlendEquationSeparate) \
    F(BLENDEQUATIONSEPARATEI, BlendEquationSeparatei) F(BLENDFUNCSEPARATE, BlendFuncSeparate) \
    F(BLENDFUNCSEPARATEI, BlendFuncSeparatei) F(BLITFRAMEBUFFER, BlitFramebuffer) \
    F(BUFFERDATA, BufferData) F(BUFFERSUBDATA, BufferSubData) \
    F(CHECKFRAMEBUFFERSTATUS, CheckFramebufferStatus) F(CLAMPCOLOR, ClampColor) \
    F(CLEAR, Clear) F(CLEARCOLOR, ClearColor) F(CLEARDEPTH, ClearDepth) \
    F(CLEARDEPTHF, ClearDepthf) F(CLEARSTENCIL, ClearStencil) F(CLIPCONTROL, ClipControl) \
    F(COLORMASK, ColorMask) F(COLORMASKI, ColorMaski) F(COMPILESHADER, CompileShader) \
    F(CREATEPROGRAM, CreateProgram) F(CREATESHADER, CreateShader) F(CULLFACE, CullFace) \
    F(DELETEBUFFERS, DeleteBuffers) F(DELETEFRAMEBUFFERS, DeleteFramebuffers) \
    F(DELETEPROGRAM, DeleteProgram) F(DELETEPROGRAMPIPELINES, DeleteProgramPipelines) \
    F(DELETEQUERIES, DeleteQueries) F(DELETERENDERBUFFERS, DeleteRenderbuffers) \
    F(DELETESAMPLERS, DeleteSamplers) F(DELETESHADER, DeleteShader) \
    F(DELETETEXTURES, DeleteTextures) F(DELETETRANSFORMFEEDBACKS, DeleteTransformFeedbacks) \
    F(DELETEVERTEXARRAYS, DeleteVertexArrays) F(DEPTHFUNC, DepthFunc) F(DEPTHMASK, DepthMask) \
    F(DEPTHRANGE, DepthRange) F(DEPTHRANGEF, DepthRangef) F(DISABLE, Disable) \
    F(DISABLEI, Disablei) F(DISABLEVERTEXATTRIBARRAY, DisableVertexAttribArray) \
    F(DRAWARRAYS, DrawArrays) F(DRAWBUFFERS, DrawBuffers) F(ENABLE, Enable) F(ENABLEI, Enablei) \
    F(ENABLEVERTEXATTRIBARRAY, EnableVertexAttribArray) F(ENDQUERY, EndQuery) \
    F(ENDTRANSFORMFEEDBACK, EndTransformFeedback) F(FINISH, Finish) \
    F(FRAMEBUFFERRENDERBUFFER, FramebufferRenderbuffer) \
    F(FRAMEBUFFERTEXTURE2D, FramebufferTexture2D) F(FRAMEBUFFERTEXTURELAYER, \
    FramebufferTextureLayer) F(FRONTFACE, FrontFace) F(GENBUFFERS, GenBuffers) \
    F(GENFRAMEBUFFERS, GenFramebuffers) F(GENPROGRAMPIPELINES, GenProgramPipelines) \
    F(GENQUERIES, GenQueries) F(GENRENDERBUFFERS, GenRenderbuffers) F(GENSAMPLERS, GenSamplers) \
    F(GENTEXTURES, GenTextures) F(GENTRANSFORMFEEDBACKS, GenTransformFeedbacks) \
    F(GENVERTEXARRAYS, GenVertexArrays) F(GETACTIVEUNIFORMBLOCKIV, GetActiveUniformBlockiv) \
    F(GETBUFFERPARAMETERIV, GetBufferParameteriv) F(GETERROR, GetError) F(GETFLOATI_V, GetFloati_v) \
    F(GETFLOATV, GetFloatv) \
    F(GETFRAMEBUFFERATTACHMENTPARAMETERIV, GetFramebufferAttachmentParameteriv) \
    F(GETINTEGER64I_V, GetInteger64i_v) F(GETINTEGER64V, GetInteger64v) \
    F(GETINTEGERI_V, GetIntegeri_v) F(GETINTEGERV, GetIntegerv) \
    F(GETPROGRAMINFOLOG, GetProgramInfoLog) F(GETPROGRAMIV, GetProgramiv) F(GETQUERYIV, GetQueryiv) \
    F(GETSAMPLERPARAMETERFV, GetSamplerParameterfv) F(GETSTRING, GetString) \
    F(GETSTRINGI, GetStringi) F(GETTEXPARAMETERFV, GetTexParameterfv) \
    F(GETUNIFORMBLOCKINDEX, GetUniformBlockIndex) F(GETUNIFORMFV, GetUniformfv) \
    F(GETUNIFORMIV, GetUniformiv) F(GETUNIFORMLOCATION, GetUniformLocation) \
    F(GETVERTEXATTRIBFV, GetVertexAttribfv) F(GETVERTEXATTRIBIV, GetVertexAttribiv) \
    F(GETVERTEXATTRIBPOINTERV, GetVertexAttribPointerv) F(HINT, Hint) F(ISBUFFER, IsBuffer) \
    F(ISENABLED, IsEnabled) F(ISENABLEDI, IsEnabledi) F(ISFRAMEBUFFER, IsFramebuffer) \
    F(ISPROGRAM, IsProgram) F(ISQUERY, IsQuery) F(ISRENDERBUFFER, IsRenderbuffer) \
    F(ISSAMPLER, IsSampler) F(ISSHADER, IsShader) F(ISTEXTURE, IsTexture) \
    F(ISVERTEXARRAY, IsVertexArray) F(LINEWIDTH, LineWidth) F(LINKPROGRAM, LinkProgram) \
    F(LOGICOP, LogicOp) F(MAPBUFFERRANGE, MapBufferRange) F(MINSAMPLESHADING, MinSampleShading) \
    F(PATCHPARAMETERFV, PatchParameterfv) F(PATCHPARAMETERI, PatchParameteri) \
    F(PAUSETRANSFORMFEEDBACK, PauseTransformFeedback) F(PIXELSTOREI, PixelStorei) \
    F(POINTPARAMETERF, PointParameterf) F(POINTPARAMETERI, PointParameteri) \
    F(POINTSIZE, PointSize) F(POLYGONMODE, PolygonMode) F(POLYGONOFFSET, PolygonOffset) \
    F(PRIMITIVERESTARTINDEX, PrimitiveRestartIndex) F(PROVOKINGVERTEX, ProvokingVertex) \
    F(READBUFFER, ReadBuffer) F(READPIXELS, ReadPixels) \
    F(RENDERBUFFERSTORAGE, RenderbufferStorage) F(SAMPLECOVERAGE, SampleCoverage) \
    F(SAMPLEMASKI, SampleMaski) F(SAMPLERPARAMETERF, SamplerParameterf) \
    F(SAMPLERPARAMETERI, SamplerParameteri) F(SCISSOR, Scissor) \
    F(SCISSORINDEXED, ScissorIndexed) F(SHADERSOURCE, ShaderSource) \
    F(STENCILFUNCSEPARATE, StencilFuncSeparate) F(STENCILMASKSEPARATE, StencilMaskSeparate) \
    F(STENCILOPSEPARATE, StencilOpSeparate) F(TEXBUFFER, TexBuffer) F(TEXIMAGE1D, TexImage1D) \
    F(TEXIMAGE2D, TexImage2D) F(TEXIMAGE2DMULTISAMPLE, TexImage2DMultisample) \
    F(TEXIMAGE3D, TexImage3D) F(TEXIMAGE3DMULTISAMPLE, TexImage3DMultisample) \
    F(TEXPARAMETERF, TexParameterf) F(TEXPARAMETERI, TexParameteri) \
    F(TEXSTORAGE2D, TexStorage2D) F(TEXSTORAGE2DMULTISAMPLE, TexStorage2DMultisample) \
    F(TEXSTORAGE3D, TexStorage3D) \
    F(TEXSTORAGE3DMULTISAMPLE, TexStorage3DMultisample) F(TEXSUBIMAGE2D, TexSubImage2D) F(TEXSUBIMAGE3D, TexSubImage3D) \
    F(RENDERBUFFERSTORAGEMULTISAMPLE, RenderbufferStorageMultisample) \
    F(GETSHADERIV, GetShaderiv) F(GETSHADERINFOLOG, GetShaderInfoLog) F(UNIFORM4FV, Uniform4fv) \
    F(TRANSFORMFEEDBACKVARYINGS, TransformFeedbackVaryings) F(UNIFORM1I, Uniform1i) \
    F(UNIFORM4F, Uniform4f) F(UNIFORMBLOCKBINDING, UniformBlockBinding) \
    F(UNMAPBUFFER, UnmapBuffer) F(USEPROGRAM, UseProgram) \
    F(VERTEXATTRIB4F, VertexAttrib4f) F(VERTEXATTRIBBINDING, VertexAttribBinding) \
    F(VERTEXATTRIBDIVISOR, VertexAttribDivisor) \
    F(VERTEXATTRIBFORMAT, VertexAttribFormat) \
    F(VERTEXATTRIBIPOINTER, VertexAttribIPointer) F(VERTEXATTRIBPOINTER, VertexAttribPointer) \
    F(VIEWPORT, Viewport) F(VIEWPORTINDEXEDF, ViewportIndexedf)
/* clang-format on */

typedef struct gl_functions {
#define GL_POINTER(NAME, Name) PFNGL##NAME##PROC Name;
    GL_FUNCTIONS(GL_POINTER)
#undef GL_POINTER
    int es, version; /* 33 is 3.3 */
} gl_functions;

/* Of the context that is current. */
static inline void gl_load(gl_functions *gl, void (*(*get)(const char *))(void)) {
    const char *text;
    GLint major = 0, minor = 0;
    void (*proc)(void);
#define GL_LOAD(NAME, Name)                                                                        \
    proc = get("gl" #Name);                                                                        \
    memcpy(&gl->Name, &proc, sizeof proc);
    GL_FUNCTIONS(GL_LOAD)
#undef GL_LOAD
    text = (const char *)gl->GetString(GL_VERSION);
    gl->GetIntegerv(GL_MAJOR_VERSION, &major);
    gl->GetIntegerv(GL_MINOR_VERSION, &minor);
    gl->es = strncmp(text, "OpenGL ES", 9) == 0;
    gl->version = 10 * major + minor;
}

#endif /* GL_FUNCTIONS_H */
