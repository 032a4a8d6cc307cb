#pragma once
// The contents of report.html, report.css and report.js in this folder, embedded by the build.

#include <string_view>

namespace etendue {

extern const std::string_view kReportHtml, kReportCss, kReportJs;

}  // namespace etendue
