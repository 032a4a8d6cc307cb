// Chooses the method by short pilots of several ones. It has no estimator of its own: the chosen method renders the whole
// image, with the same bits as if it had been asked for.

#include "integrator/auto.h"

#include "integrator/bdpt.h"

namespace etendue {

int threads_of_auto(const IntegratorParams& params) {
    return params.integer("threads", 1, 4096);
}

const IntegratorEntry& auto_entry() {
    static const IntegratorEntry entry{
        {"integrator",
         "auto",
         "Chooses among path, bdpt, pcbpt, upg+bdpt, mlt and mmlt, by short pilots of each on a "
         "small film. Unbiased.",
         {depth_params()[0],
          {"chains", ParamKind::Bool, "true",
           "Whether methods with Markov chains are candidates. They are none where several "
           "processes render together."},
          {"consistent", ParamKind::Bool, "false",
           "Whether vcm is a candidate, which is biased, but consistent."},
          {"threads", ParamKind::Int, "1",
           "Number of threads by which --time is multiplied, in [1, 4096]: with it, the choice is "
           "that for a rendering on so many threads, on any machine."},
          {"user_paths", ParamKind::String, "",
           "JSON file of important light sub-paths for mlt, as in mlt."}}},
        [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
            p.flag("chains"), p.flag("consistent"), p.integer("max_depth");
            threads_of_auto(p);
            return make_integrator({"bdpt", {{"max_depth", p.string("max_depth")}}});
        }};
    return entry;
}

}  // namespace etendue
