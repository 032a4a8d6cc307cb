#include "studio/server.h"

#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <deque>
#include <limits>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/chunk_encode.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/http/write.hpp>

#include "system/available_memory.h"

namespace etendue {
namespace {

namespace net = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using tcp = net::ip::tcp;
using boost::system::error_code;
using Parser = http::request_parser<http::string_body>;

constexpr auto kTimeout = std::chrono::milliseconds(int64_t(1000 * Server::kTimeout));
constexpr auto kEventInterval = std::chrono::milliseconds(100);
constexpr int kHeartbeat = 50;  ///< Event intervals.

std::string text(beast::string_view s) {
    return {s.data(), s.size()};
}

/// For the header; it decides how long the body may be, see limit_body().
void set_limits(Parser& parser) {
    parser.header_limit(kMostHeaderBytes);
    parser.body_limit(std::numeric_limits<uint64_t>::max());  // boost::none refuses all bodies
}

/// Whether the body of the request, whose header is read, may be as long as the header says.
bool limit_body(Parser& parser, bool brings_file) {
    const size_t most = brings_file ? kMostFileBytes : kMostBodyBytes;
    parser.body_limit(most);  // of one whose length is not known
    return parser.content_length().value_or(0) <= most;
}

Request request_of(Parser& parser) {
    http::request<http::string_body>& m = parser.get();
    return {.method = text(m.method_string()),
            .target = text(m.target()),
            .host = text(m[http::field::host]),
            .origin = text(m[http::field::origin]),
            .fetch_site = text(m["Sec-Fetch-Site"]),
            .authorization = text(m[http::field::authorization]),
            .if_match = text(m[http::field::if_match]),
            .body = std::move(m.body()),
            .local_address = {}};
}

Reply refusal_of_body(bool brings_file) {
    return Reply::error(413, fmt::format("the body is larger than {} MiB",
                                         (brings_file ? kMostFileBytes : kMostBodyBytes) >> 20));
}

Reply refusal_of(const error_code& error, bool brings_file) {
    if (error == http::error::body_limit) return refusal_of_body(brings_file);
    if (error == http::error::header_limit || error == http::error::buffer_overflow)
        return Reply::error(431, "the header is larger than 8 KiB");
    return Reply::error(400, "this is no HTTP request");
}

/// Sent with every reply.
void set_common_fields(http::response<http::empty_body>& m) {
    m.set("Content-Security-Policy",
          "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
          "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'");
    m.set("X-Content-Type-Options", "nosniff");
    m.set("Referrer-Policy", "no-referrer");
    m.set("Cross-Origin-Resource-Policy", "same-origin");
    m.set(http::field::cache_control, "no-store");
}

/// An address as a request may name it as its host: an IPv4 address also where it arrives at an IPv6 socket, and without
/// the name of an interface.
std::string text_of(net::ip::address address) {
    if (address.is_v6()) {
        net::ip::address_v6 v6 = address.to_v6();
        if (v6.is_v4_mapped()) return net::ip::make_address_v4(net::ip::v4_mapped, v6).to_string();
        v6.scope_id(0);
        return v6.to_string();
    }
    return address.to_string();
}

/// What the connections share. Threads of the workers may be the last to drop a connection.
struct Common {
    Handler* handler = nullptr;
    std::atomic<int> known = 0, event_streams = 0;
    std::atomic<uint64_t> file_bytes =
        0;  ///< Of the files that requests bring, until they are answered.
};

/// One connection: requests are answered one after the other.
class Connection : public std::enable_shared_from_this<Connection> {
public:
    Connection(tcp::socket socket, Common& common)
        : stream_(std::move(socket)), timer_(stream_.get_executor()), handler_(*common.handler),
          common_(common) {
        error_code ignored;
        stream_.socket().set_option(tcp::no_delay(true), ignored);
        local_address_ = text_of(stream_.socket().local_endpoint(ignored).address());
    }
    ~Connection() {
        if (is_known_) --common_.known;
        if (is_event_stream_) --common_.event_streams;
        release();
    }

    bool is_known() const { return is_known_; }
    /// At once, whatever it does.
    void abort() {
        error_code ignored;
        timer_.cancel(ignored);
        stream_.close();
    }

    void read() {
        parser_.emplace();
        set_limits(*parser_);
        admission_ = {};
        stream_.expires_after(kTimeout);
        http::async_read_header(stream_, buffer_, *parser_,
                                [self = shared_from_this()](const error_code& error, size_t) {
                                    if (self->can_read(error)) self->on_header();
                                });
    }

private:
    void refuse(Reply reply) {
        keep_alive_ = false;
        write(std::move(reply));
    }

    /// Answers or closes after an error.
    bool can_read(const error_code& error) {
        if (!error) return true;
        if (error == http::error::end_of_stream || error == beast::error::timeout) {
            close();
            return false;
        }
        // Errors of the connection itself cannot be answered.
        if (error.category() == http::make_error_code(http::error::bad_method).category())
            refuse(refusal_of(error, admission_.brings_file));
        return false;
    }

    void on_header() {
        Request request = request_of(*parser_);
        request.local_address = local_address_;
        admission_ = handler_.admit(request);
        if (!limit_body(*parser_, admission_.brings_file))
            return refuse(refusal_of_body(admission_.brings_file));
        if (admission_.has_token && !is_known_) {
            if (common_.known >= Server::kMostConnections)
                return refuse(Reply::error(503, "there are too many connections"));
            ++common_.known;
            is_known_ = true;
        }
        read_body();
    }

    /// The bytes that a file has, or has so far where its length is not known, in steps that are worth asking for memory.
    uint64_t file_bytes() const {
        constexpr uint64_t kStep = 16 << 20;
        if (const auto length = parser_->content_length()) return *length;
        return (parser_->get().body().size() + kStep - 1) / kStep * kStep;
    }
    /// Takes a share of what files may have, and of the memory, for the file that the request brings; a reply where there
    /// is too little.
    std::optional<Reply> reserve() {
        // The body, what it is decoded to, and as much for a rendering, which should not fail beside it.
        constexpr uint64_t kMemoryPerByte = 3;
        const uint64_t bytes = file_bytes(), more = bytes - std::min(bytes, reserved_);
        if (more == 0) return {};
        if (common_.file_bytes + more > kMostFileBytesAtATime)
            return Reply::error(503, "too many files are opened at a time; try again");
        try {
            require_memory(kMemoryPerByte * more, "the file");
        } catch (const std::runtime_error& e) {
            return Reply::error(503, e.what());
        }
        common_.file_bytes += more;
        reserved_ += more;
        return {};
    }
    void release() { common_.file_bytes -= std::exchange(reserved_, 0); }

    /// In pieces, each with its own time limit.
    void read_body() {
        if (admission_.brings_file)
            if (auto refusal = reserve()) return refuse(std::move(*refusal));
        if (parser_->is_done()) return on_request();
        stream_.expires_after(kTimeout);
        http::async_read_some(stream_, buffer_, *parser_,
                              [self = shared_from_this()](const error_code& error, size_t) {
                                  if (self->can_read(error)) self->read_body();
                              });
    }

    void on_request() {
        keep_alive_ = parser_->get().keep_alive();
        is_head_ = parser_->get().method() == http::verb::head;
        Request request = request_of(*parser_);
        request.local_address = local_address_;
        if (admission_.refusal) return write(std::move(*admission_.refusal));
        if (admission_.is_events) {
            if (common_.event_streams < Server::kMostEventStreams) return stream_events();
            return write(Reply::error(429, fmt::format("{} pages are open already; close one",
                                                       Server::kMostEventStreams)));
        }
        stream_.expires_never();
        handler_.handle(std::move(request), [self = shared_from_this(),
                                             executor = stream_.get_executor()](Reply reply) {
            net::post(executor, [self, reply = std::move(reply)]() mutable {
                self->write(std::move(reply));
            });
        });
    }

    void write(Reply reply) {
        release();
        body_ = reply.shared_body ? std::move(reply.shared_body)
                                  : std::make_shared<const std::string>(std::move(reply.body));
        written_ = 0;
        header_ = {};
        header_.version(11);
        header_.result(unsigned(reply.status));
        set_common_fields(header_);
        if (reply.status != 204) header_.set(http::field::content_type, reply.type);
        if (!reply.etag.empty()) header_.set(http::field::etag, reply.etag);
        if (reply.status == 401) header_.set(http::field::www_authenticate, "Bearer");
        header_.keep_alive(keep_alive_);
        if (reply.status != 204) header_.content_length(body_->size());
        write_header([self = shared_from_this()] { self->write_body(); });
    }

    template <class Next>
    void write_header(Next next) {
        serializer_.emplace(header_);
        stream_.expires_after(kTimeout);
        http::async_write_header(
            stream_, *serializer_,
            [self = shared_from_this(), next = std::move(next)](const error_code& error, size_t) {
                if (!error) next();
            });
    }

    /// In pieces, each with its own time limit.
    void write_body() {
        constexpr size_t kPiece = 256 << 10;
        if (is_head_ || written_ == body_->size()) {
            if (keep_alive_) return read();
            return linger();
        }
        const size_t size = std::min(kPiece, body_->size() - written_);
        stream_.expires_after(kTimeout);
        net::async_write(stream_, net::buffer(body_->data() + written_, size),
                         [self = shared_from_this(), size](const error_code& error, size_t) {
                             if (error) return;
                             self->written_ += size;
                             self->write_body();
                         });
    }

    /// Reads what the client still sends, for a short time: closing earlier could lose the reply on its way.
    void linger() {
        error_code ignored;
        stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
        stream_.expires_after(std::chrono::seconds(2));
        discard();
    }
    void discard() {
        scratch_.resize(64 << 10);
        stream_.async_read_some(net::buffer(scratch_),
                                [self = shared_from_this()](const error_code& error, size_t size) {
                                    constexpr size_t kMost = 16 << 20;
                                    self->discarded_ += size;
                                    if (!error && self->discarded_ < kMost) self->discard();
                                });
    }
    void close() {
        error_code ignored;
        stream_.socket().shutdown(tcp::socket::shutdown_both, ignored);
    }

    // -- Events.

    void stream_events() {
        is_event_stream_ = true;
        ++common_.event_streams;
        header_ = {};
        header_.version(11);
        header_.result(http::status::ok);
        set_common_fields(header_);
        header_.set(http::field::content_type, "application/x-ndjson");
        header_.chunked(true);
        write_header([self = shared_from_this()] { self->watch_for_end(), self->send_event(); });
    }
    /// A client that closes its page is noticed at once.
    void watch_for_end() {
        scratch_.resize(1024);
        stream_.socket().async_read_some(
            net::buffer(scratch_), [self = shared_from_this()](const error_code& error, size_t) {
                if (!error) return self->watch_for_end();
                self->is_ended_ = true;
                self->timer_.cancel();
            });
    }
    void send_event() {
        if (is_ended_) return;
        try {
            const uint64_t revision = handler_.revision();
            if (revision == seen_ && ++idle_ < kHeartbeat) return wait();
            seen_ = revision;
            idle_ = 0;
            event_ = handler_.event() + "\n";
        } catch (const std::exception&) {
            return abort();  // watch_for_end() would keep a connection that is silent
        }
        stream_.expires_after(kTimeout);
        net::async_write(stream_, http::make_chunk(net::buffer(event_)),
                         [self = shared_from_this()](const error_code& error, size_t) {
                             if (!error) return self->wait();
                             self->close();
                         });
    }
    void wait() {
        stream_.expires_never();
        timer_.expires_after(kEventInterval);
        timer_.async_wait([self = shared_from_this()](const error_code& error) {
            if (!error) self->send_event();
        });
    }

    beast::tcp_stream stream_;
    net::steady_timer timer_;
    Handler& handler_;
    Common& common_;
    std::string local_address_;
    beast::flat_buffer buffer_{kMostHeaderBytes + kMostBodyBytes};
    std::optional<Parser> parser_;
    http::response<http::empty_body> header_;
    std::optional<http::response_serializer<http::empty_body>> serializer_;
    std::shared_ptr<const std::string> body_;
    std::string event_;
    std::vector<char> scratch_;
    size_t written_ = 0, discarded_ = 0;
    bool is_known_ = false;  ///< A request had the token.
    bool keep_alive_ = false, is_head_ = false, is_event_stream_ = false, is_ended_ = false;
    Admission admission_;    ///< Of the request that is read.
    uint64_t reserved_ = 0;  ///< Of common_.file_bytes.
    uint64_t seen_ = 0;
    int idle_ = 0;
};

}  // namespace

struct Server::Impl {
    Common common;  // Outlives the connections, which `io` keeps.
    std::string address;
    net::io_context io{1};
    tcp::acceptor acceptor{io};
    net::steady_timer pause{io};
    bool is_accepting = false;
    std::deque<std::weak_ptr<Connection>> strangers;  ///< From the oldest on.
    std::thread thread;

    void listen(int port);
    void accept();
    void accept_later();
    void take(tcp::socket socket);
    void run();
    void end();
};

void Server::Impl::listen(int port) {
    std::vector<tcp::endpoint> endpoints;
    error_code error;
    if (const auto given = net::ip::make_address(address, error); !error) {
        endpoints.emplace_back(given, uint16_t(port));
    } else {
        tcp::resolver resolver(io);
        for (const auto& found : resolver.resolve(address, std::to_string(port)))
            endpoints.push_back(found.endpoint());
    }
    for (size_t i = 0; i < endpoints.size(); ++i) try {
            if (acceptor.is_open()) acceptor.close();
            acceptor.open(endpoints[i].protocol());
            acceptor.set_option(net::socket_base::reuse_address(true));
            acceptor.bind(endpoints[i]);
            acceptor.listen();
            return;
        } catch (const boost::system::system_error&) {
            if (i + 1 == endpoints.size()) throw;
        }
}

void Server::Impl::take(tcp::socket socket) {
    std::erase_if(strangers, [](const std::weak_ptr<Connection>& weak) {
        const auto connection = weak.lock();
        return !connection || connection->is_known();
    });
    if (strangers.size() >= kMostStrangers) {
        if (const auto oldest = strangers.front().lock()) oldest->abort();
        strangers.pop_front();
    }
    const auto connection = std::make_shared<Connection>(std::move(socket), common);
    strangers.push_back(connection);
    connection->read();
}

void Server::Impl::accept() {
    acceptor.async_accept([this](const error_code& error, tcp::socket socket) {
        is_accepting = false;
        if (error == net::error::operation_aborted) return;
        // Such as a lack of file descriptors, which lasts.
        if (error && error != net::error::connection_aborted) return accept_later();
        if (!error) take(std::move(socket));
        accept();
    });
    is_accepting = true;
}

void Server::Impl::accept_later() {
    pause.expires_after(kEventInterval);
    pause.async_wait([this](const error_code& error) {
        is_accepting = false;
        if (!error) accept();
    });
    is_accepting = true;
}

void Server::Impl::run() {
    while (true) try {
            if (!is_accepting) accept();
            io.run();
            return;
        } catch (const std::exception&) {
            // Mostly a lack of memory. The connection whose turn it was is closed; the others go on.
            std::this_thread::sleep_for(kEventInterval);
        }
}

void Server::Impl::end() {
    io.stop();
    if (thread.joinable()) thread.join();
}

Server::Server(const std::string& address, int port) : impl_(std::make_unique<Impl>()) {
    impl_->address = address;
    try {
        impl_->listen(port);
    } catch (const boost::system::system_error& e) {
        throw std::runtime_error(
            fmt::format("cannot listen at {}, port {}: {}", address, port, e.code().message()));
    }
}

Server::~Server() {
    impl_->end();
}

int Server::port() const {
    return impl_->acceptor.local_endpoint().port();
}

bool Server::is_local() const {
    return impl_->acceptor.local_endpoint().address().is_loopback();
}

namespace {

/// The addresses of the machine, without those that are valid in one link only; the loopback address last.
std::vector<std::string> own_addresses(bool with_v6) {
    std::vector<std::string> addresses, loopback;
    ifaddrs* list = nullptr;
    if (getifaddrs(&list) != 0) return {"127.0.0.1"};
    for (const ifaddrs* i = list; i; i = i->ifa_next) {
        if (!i->ifa_addr || !(i->ifa_flags & IFF_UP)) continue;
        net::ip::address address;
        if (i->ifa_addr->sa_family == AF_INET) {
            const auto* v4 = reinterpret_cast<const sockaddr_in*>(i->ifa_addr);
            address = net::ip::address_v4(ntohl(v4->sin_addr.s_addr));
        } else if (i->ifa_addr->sa_family == AF_INET6 && with_v6) {
            net::ip::address_v6::bytes_type bytes;
            const auto* v6 = reinterpret_cast<const sockaddr_in6*>(i->ifa_addr);
            std::copy_n(v6->sin6_addr.s6_addr, bytes.size(), bytes.begin());
            address = net::ip::address_v6(bytes);
            if (address.to_v6().is_link_local()) continue;
        } else {
            continue;
        }
        (address.is_loopback() ? loopback : addresses).push_back(text_of(address));
    }
    freeifaddrs(list);
    addresses.insert(addresses.end(), loopback.begin(), loopback.end());
    return addresses;
}

}  // namespace

std::string Server::url(const std::string& host) const {
    // The brackets of IPv6 addresses keep their colons apart from that of the port.
    return host.find(':') != std::string::npos ? fmt::format("http://[{}]:{}", host, port())
                                               : fmt::format("http://{}:{}", host, port());
}

std::vector<std::string> Server::urls() const {
    const auto address = impl_->acceptor.local_endpoint().address();
    std::vector<std::string> urls;
    if (!address.is_unspecified()) return {url(impl_->address)};
    for (const std::string& own : own_addresses(address.is_v6())) urls.push_back(url(own));
    return urls;
}

Server::Serving Server::start(Handler& handler) {
    impl_->common.handler = &handler;
    impl_->thread = std::thread([impl = impl_.get()] { impl->run(); });
    return Serving(*this);
}

Server::Serving::~Serving() {
    server_.impl_->end();
}

ParsedRequest parse_request(std::string_view bytes) {
    Parser parser;
    set_limits(parser);
    error_code error;
    const size_t header = parser.put(net::buffer(bytes.data(), bytes.size()), error);
    if (!error && parser.is_header_done() && !limit_body(parser, false))
        return {{}, refusal_of_body(false)};
    parser.eager(true);
    const std::string_view rest = bytes.substr(header);
    if (!error && !parser.is_done() && !rest.empty())
        parser.put(net::buffer(rest.data(), rest.size()), error);
    if (!error && !parser.is_done()) parser.put_eof(error);
    if (error) return {{}, refusal_of(error, false)};
    return {request_of(parser), {}};
}

}  // namespace etendue
