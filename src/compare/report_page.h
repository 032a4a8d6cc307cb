#pragma once
// The files report.html, report.css and report.js of this folder, as they are; the build makes the definitions.

#include <string_view>

namespace etendue {

extern const std::string_view kReportHtml, kReportCss, kReportJs;

}  // namespace etendue
