#pragma once
// Requests and replies without sockets.

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace etendue {

/// The largest header and body of a request that are read.
inline constexpr size_t kMostHeaderBytes = 8 << 10, kMostBodyBytes = 1 << 20;

struct Request {
    std::string method, target;
    /// Header fields; empty where absent.
    std::string host, origin, fetch_site, authorization, if_match;
    std::string body;
    std::string local_address;  ///< To which the connection was made, without port.

    std::string_view path() const { return std::string_view(target).substr(0, target.find('?')); }
    /// The value of a query parameter, decoded; empty where it is absent or given twice.
    std::optional<std::string> query(std::string_view name) const;
};

struct Reply {
    int status = 200;
    std::string type = "application/json";
    std::string body;
    std::string etag;  ///< Empty if there is none.

    static Reply json(std::string text) { return {200, "application/json", std::move(text), {}}; }
    /// {"error": message}
    static Reply error(int status, std::string_view message);
};

/// The interface between server and application. The server's thread calls all functions except `done`.
class Handler {
public:
    virtual ~Handler() = default;
    /// Calls `done` once, from any thread.
    virtual void handle(const Request& request, std::function<void(Reply)> done) = 0;
    /// Whether the reply to a request is a stream of events. If the request is rejected, sets `refused`.
    virtual bool is_events(const Request& request, std::optional<Reply>& refused) = 0;
    /// Changes with the next event.
    virtual uint64_t revision() = 0;
    /// One line of JSON, without its end.
    virtual std::string event() = 0;
};

}  // namespace etendue
