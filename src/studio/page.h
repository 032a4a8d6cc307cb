#pragma once
// The files of the page, embedded by the build.

#include <string_view>

namespace etendue {

extern const std::string_view kIndexHtml, kStudioCss, kMainJs, kServerJs, kViewJs, kControlsJs,
    kPlotJs, kSpaceJs, kPathsJs, kInspectorJs, kHistogramJs;

}  // namespace etendue
