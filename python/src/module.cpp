#include "bindings.h"

NB_MODULE(_etendue, m) {
    using namespace etendue::python;
    m.doc() = "The compiled part of etendue.";
    m.attr("__version__") = ETENDUE_VERSION;
    watch_forks();
    bind_memory(m);
    bind_description(m);
    bind_images(m);
    bind_rays(m);
    bind_scattering(m);
    bind_techniques(m);
    bind_sub_paths(m);
    bind_integrators(m);
    bind_path_records(m);
    bind_render(m);
    bind_reports(m);
}
