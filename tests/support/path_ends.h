#pragma once
// End points that are sampled by joins, as vertices for the reference definitions of path_pdfs.h.

#include "pathspace/path_pdfs.h"

namespace etendue::test {

using etendue::emitter_end;
using etendue::lens_end;

}  // namespace etendue::test
