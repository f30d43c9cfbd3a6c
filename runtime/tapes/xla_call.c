/* Handler of XLA that calls the batch function of a kernel on the buffers of an array program.
 *
 * Inputs are (..., size): leading axes broadcast. The text attribute "function" names a kernel that
 * symgen_add has entered: addresses differ from process to process, and a compiled program may be
 * kept. Doubles of one sample or of all are used in place; single precision is converted, and an
 * array for some of the axes repeated. C alone: xla/ffi/api/c_api.h needs no C++. */
#include <stdlib.h>
#include <string.h>

#include "xla/ffi/api/c_api.h"

#define MOST 6 /* inputs */
#define AXES 16

#define KERNELS 8192 /* of all libraries of a process */

static struct {
    char name[96];
    void *function;
} entries[KERNELS];
static int known = 0;

static int place_of(const char *name, size_t length)
{
    int k = 0;
    while (k < known && (strlen(entries[k].name) != length || memcmp(entries[k].name, name, length))) {
        ++k;
    }
    return k;
}

/* Called by one thread, before any program that names the function is compiled. */
int symgen_add(const char *name, void *function)
{
    const int k = place_of(name, strlen(name));
    if (k == KERNELS || strlen(name) >= sizeof entries[k].name) {
        return 1;
    }
    strcpy(entries[k].name, name);
    entries[k].function = function;
    known += k == known;
    return 0;
}

static XLA_FFI_Error *fault(const XLA_FFI_CallFrame *frame, const char *message)
{
    XLA_FFI_Error_Create_Args args = {0};
    args.struct_size = XLA_FFI_Error_Create_Args_STRUCT_SIZE;
    args.message = message;
    args.errc = XLA_FFI_Error_Code_INVALID_ARGUMENT;
    return frame->api->XLA_FFI_Error_Create(&args);
}

#define IN(k) in[k], step[k]
static int call(void *function, long n, const double **in, const long *step, double **out, int ins, int outs)
{
    typedef const double *P;
    switch (10 * ins + outs) {
    case 11: ((void (*)(long, P, long, double *))function)(n, IN(0), out[0]); return 0;
    case 12: ((void (*)(long, P, long, double *, double *))function)(n, IN(0), out[0], out[1]); return 0;
    case 21: ((void (*)(long, P, long, P, long, double *))function)(n, IN(0), IN(1), out[0]); return 0;
    case 31: ((void (*)(long, P, long, P, long, P, long, double *))function)(n, IN(0), IN(1), IN(2), out[0]); return 0;
    case 41: ((void (*)(long, P, long, P, long, P, long, P, long, double *))function)(n, IN(0), IN(1), IN(2), IN(3), out[0]); return 0;
    case 44: ((void (*)(long, P, long, P, long, P, long, P, long, double *, double *, double *, double *))function)(n, IN(0), IN(1), IN(2), IN(3), out[0], out[1], out[2], out[3]); return 0;
    case 51: ((void (*)(long, P, long, P, long, P, long, P, long, P, long, double *))function)(n, IN(0), IN(1), IN(2), IN(3), IN(4), out[0]); return 0;
    case 63: ((void (*)(long, P, long, P, long, P, long, P, long, P, long, P, long, double *, double *, double *))function)(n, IN(0), IN(1), IN(2), IN(3), IN(4), IN(5), out[0], out[1], out[2]); return 0;
    default: return 1;
    }
}

static long numbers(const XLA_FFI_Buffer *b)
{
    long all = 1;
    for (int64_t k = 0; k < b->rank; ++k) {
        all *= (long)b->dims[k];
    }
    return all;
}

/* Row of an input whose axes of length 1 broadcast, for one of the samples of all inputs. */
static long row_of(const XLA_FFI_Buffer *b, const int64_t *lead, int64_t axes, long sample)
{
    long row = 0, stride = 1;
    for (int64_t k = axes - 1; k >= 0; --k) {
        row += b->dims[k] == 1 ? 0 : sample % (long)lead[k] * stride;
        stride *= (long)b->dims[k];
        sample /= (long)lead[k];
    }
    return row;
}

XLA_FFI_Error *symgen_kernel(XLA_FFI_CallFrame *frame);
XLA_FFI_Error *symgen_kernel(XLA_FFI_CallFrame *frame)
{
    if (frame->extension_start && frame->extension_start->type == XLA_FFI_Extension_Metadata) {
        XLA_FFI_Metadata *facts = ((XLA_FFI_Metadata_Extension *)frame->extension_start)->metadata;
        facts->api_version.major_version = XLA_FFI_API_MAJOR;
        facts->api_version.minor_version = XLA_FFI_API_MINOR;
        return 0;
    }
    const int ins = (int)frame->args.size, outs = (int)frame->rets.size;
    const XLA_FFI_ByteSpan *name = frame->attrs.size ? frame->attrs.attrs[0] : 0;
    const int found = name ? place_of(name->ptr, name->len) : known;
    if (found == known) {
        return fault(frame, "symgen: this program was compiled for a library that is not loaded; call runtime.jax(lib) first");
    }
    XLA_FFI_Buffer **args = (XLA_FFI_Buffer **)frame->args.args, **rets = (XLA_FFI_Buffer **)frame->rets.rets;
    const int64_t axes = ins ? args[0]->rank - 1 : AXES; /* leading ones, of all inputs */
    if (ins < 1 || ins > MOST || outs > MOST || axes >= AXES) {
        return fault(frame, "symgen: the kernel has more inputs, or its arrays more axes, than a call can pass");
    }
    const int is_single = args[0]->dtype == XLA_FFI_DataType_F32;
    int64_t lead[AXES];
    long total = 1, need = 1, step[MOST];
    for (int64_t k = 0; k < axes; ++k) {
        lead[k] = 1;
        for (int i = 0; i < ins; ++i) {
            lead[k] = args[i]->dims[k] != 1 ? args[i]->dims[k] : lead[k];
        }
        total *= (long)lead[k];
    }
    int is_copied[MOST];
    for (int i = 0; i < ins; ++i) { /* in place: one sample for all, or every sample */
        const long size = (long)args[i]->dims[axes], here = numbers(args[i]);
        step[i] = here == size ? 0 : size;
        is_copied[i] = is_single || (here != size && here != total * size);
        need += is_copied[i] ? (step[i] ? total : 1) * size : 0;
    }
    for (int i = 0; i < outs; ++i) {
        need += is_single ? numbers(rets[i]) : 0;
    }
    double *work = need > 1 ? malloc((size_t)need * sizeof *work) : 0, *at = work;
    if (need > 1 && !work) {
        return fault(frame, "symgen: no memory to convert or repeat an array");
    }
    const double *in[MOST];
    double *out[MOST];
    for (int i = 0; i < ins; ++i) {
        in[i] = is_copied[i] ? at : args[i]->data;
        const long size = (long)args[i]->dims[axes], rows = !is_copied[i] ? 0 : step[i] ? total : 1;
        for (long k = 0; k < rows; ++k) {
            const long first = row_of(args[i], lead, axes, k) * size;
            for (long j = 0; j < size; ++j) {
                *at++ = is_single ? ((const float *)args[i]->data)[first + j] : ((const double *)args[i]->data)[first + j];
            }
        }
    }
    for (int i = 0; i < outs; ++i) {
        out[i] = is_single ? at : rets[i]->data;
        at += is_single ? numbers(rets[i]) : 0;
    }
    const int wrong = call(entries[found].function, total, in, step, out, ins, outs);
    for (int i = 0; i < outs; ++i) {
        for (long k = 0; is_single && k < numbers(rets[i]); ++k) {
            ((float *)rets[i]->data)[k] = (float)out[i][k];
        }
    }
    free(work);
    return wrong ? fault(frame, "symgen: the kernel has arguments that this call cannot pass") : 0;
}
