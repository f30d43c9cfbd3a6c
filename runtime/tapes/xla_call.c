/* Handler of XLA that calls the batch function of a kernel on the buffers of an array program.
 *
 * Inputs are (..., size): leading axes broadcast, and the innermost of them is the batch. The text
 * attribute "function" names a kernel that symgen_add has entered: addresses differ from process
 * to process, and a compiled program may be kept. Buffers of doubles are used in place, those of
 * single precision are converted. C alone: xla/ffi/api/c_api.h needs no C++. */
#include <stdlib.h>
#include <string.h>

#include "xla/ffi/api/c_api.h"

#define NAMES 128
#define MOST 6 /* inputs */

typedef struct {
    char name[NAMES];
    void *function;
    int summed;
} entry;

static entry *entries = 0;
static long count = 0, room = 0;

/* Called by one thread, before any program that names the function is compiled. */
int symgen_add(const char *name, void *function, int summed)
{
    for (long k = 0; k < count; ++k) {
        if (!strcmp(entries[k].name, name)) {
            entries[k].function = function;
            return 0;
        }
    }
    if (strlen(name) >= NAMES) {
        return 1;
    }
    if (count == room) { /* the old table stays: another thread may be reading it */
        entry *larger = malloc((size_t)(2 * room + 64) * sizeof *larger);
        if (!larger) {
            return 1;
        }
        if (count) {
            memcpy(larger, entries, (size_t)count * sizeof *larger);
        }
        entries = larger;
        room = 2 * room + 64;
    }
    strcpy(entries[count].name, name);
    entries[count].function = function;
    entries[count].summed = summed;
    ++count;
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
    const entry *found = 0;
    for (long k = 0; name && k < count; ++k) {
        if (strlen(entries[k].name) == name->len && !memcmp(entries[k].name, name->ptr, name->len)) {
            found = entries + k;
        }
    }
    if (!found) {
        return fault(frame, "symgen: this program was compiled for a library that is not loaded; call runtime.jax(lib) first");
    }
    if (ins < 1 || ins > MOST || outs > MOST) {
        return fault(frame, "symgen: the kernel has more inputs than a call can pass");
    }
    XLA_FFI_Buffer **args = (XLA_FFI_Buffer **)frame->args.args, **rets = (XLA_FFI_Buffer **)frame->rets.rets;
    const int64_t axes = args[0]->rank - 1; /* leading ones, of all inputs */
    const int is_single = args[0]->dtype == XLA_FFI_DataType_F32;
    const double *in[MOST];
    double *out[MOST], *work = 0;
    long step[MOST], size[MOST], of_result[MOST], total = 1;
    for (int64_t k = 0; k < axes; ++k) {
        long most = 1;
        for (int i = 0; i < ins; ++i) {
            most = args[i]->dims[k] != 1 ? (long)args[i]->dims[k] : most;
        }
        total *= most;
    }
    if (is_single) {
        long need = 1;
        for (int i = 0; i < ins; ++i) {
            need += numbers(args[i]);
        }
        for (int i = 0; i < outs; ++i) {
            need += numbers(rets[i]);
        }
        work = malloc((size_t)need * sizeof *work);
        if (!work) {
            return fault(frame, "symgen: no memory to convert from single precision");
        }
    }
    double *at = work;
    int plain = 1; /* every input is one sample or all of them */
    for (int i = 0; i < ins; ++i) {
        const long here = numbers(args[i]);
        size[i] = (long)args[i]->dims[axes];
        in[i] = args[i]->data;
        if (is_single) {
            for (long k = 0; k < here; ++k) {
                at[k] = ((const float *)args[i]->data)[k];
            }
            in[i] = at;
            at += here;
        }
        plain &= here == size[i] || here == total * size[i];
        step[i] = here == size[i] ? 0 : size[i];
    }
    for (int i = 0; i < outs; ++i) {
        out[i] = is_single ? at : rets[i]->data;
        at = is_single ? at + numbers(rets[i]) : at;
        of_result[i] = total ? numbers(rets[i]) / total : 0;
    }
    int wrong = 0;
    if (plain) {
        wrong = call(found->function, total, in, step, out, ins, outs);
    } else if (found->summed) {
        wrong = 1;
    } else { /* the last axis is the batch; the others are counted like digits */
        long n = 1, place[MOST] = {0};
        for (int i = 0; i < ins; ++i) {
            n = args[i]->dims[axes - 1] != 1 ? (long)args[i]->dims[axes - 1] : n;
        }
        for (int i = 0; i < ins; ++i) {
            step[i] = args[i]->dims[axes - 1] == 1 ? 0 : size[i];
        }
        for (long outer = 0; outer < (n ? total / n : 0) && !wrong; ++outer) {
            const double *here[MOST];
            double *result[MOST];
            for (int i = 0; i < ins; ++i) {
                long rest = outer, stride = (long)args[i]->dims[axes - 1] * size[i];
                place[i] = 0;
                for (int64_t k = axes - 2; k >= 0; --k) {
                    long most = 1;
                    for (int j = 0; j < ins; ++j) {
                        most = args[j]->dims[k] != 1 ? (long)args[j]->dims[k] : most;
                    }
                    place[i] += args[i]->dims[k] == 1 ? 0 : rest % most * stride;
                    rest /= most;
                    stride *= (long)args[i]->dims[k];
                }
                here[i] = in[i] + place[i];
            }
            for (int i = 0; i < outs; ++i) {
                result[i] = out[i] + outer * n * of_result[i];
            }
            wrong = call(found->function, n, here, step, result, ins, outs);
        }
    }
    if (is_single) {
        for (int i = 0; i < outs; ++i) {
            const long here = numbers(rets[i]);
            for (long k = 0; k < here; ++k) {
                ((float *)rets[i]->data)[k] = (float)out[i][k];
            }
        }
        free(work);
    }
    return wrong ? fault(frame, "symgen: the kernel has arguments that this call cannot pass") : 0;
}
